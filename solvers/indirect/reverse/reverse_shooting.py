"""Reverse shooting: from the end manifold backwards, Newton on the redundancy alone."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import casadi as ca
import numpy as np

from ocp import (
    OCP,
    RK4,
    InitialGuess,
    Integrator,
    ProblemError,
    Status,
    UnsupportedProblem,
    Work,
)
from ocp.internal import (
    MethodProgram,
    MethodSolver,
    RunData,
    RunResult,
    check_flag,
    check_instance,
    check_positive,
    check_whole,
    require_explicit,
)
from solvers.indirect.newton_iteration import NewtonResult, Solve, newton
from solvers.indirect.reverse.chart import Chart
from solvers.indirect.reverse.invariant_manifold import InvariantManifold, Manifold, out_of_reach
from solvers.indirect.reverse.reverse_flow import ReverseFlow
from solvers.indirect.reverse.start_conditions import refuse_what_reverse_cannot, transversality
from solvers.indirect.shooting_segments import SegmentTrajectories, ShootingSchedule

# A start further than this from where it has to be is another one; a nearer one is inaccurate.
_ELSEWHERE, _INACCURATE = 1e-3, 1e-6
_MOST_CHARTS = 5

Boundary = Literal[2, 3, 4]


@dataclass(frozen=True)
class ReverseShooting(MethodSolver):
    r"""Integrate backwards from the end manifold, where the costate is known.

    .. math:: r_1(t_1) = f(\theta(t_1)), \quad \psi(t_1) = \varphi_x(\theta(t_1))

    leaves the n - m1 redundant degrees of freedom of the end configuration. Newton finds them
    from what has to hold at t0, with exact sensitivities along the trajectory:

    * ``boundary=2`` (thesis 3.45 to 3.47): free start, N psi(t0) = 0 and r1(t0) = f(theta(t0))
      as residuals; the unknown is the whole end configuration.
    * ``boundary=3`` (3.52 to 3.54): the same, the manifold imposed at t1, where the exact
      dynamics carry it to t0; n - m1 unknowns.
    * ``boundary=4`` (3.55 to 3.57): start given; its test is N(theta0) (theta_int - theta0) = 0,
      since the rest of theta_int = theta0 holds by itself; n - m1 unknowns.

    The manifold is that of the problem's invariants (where there are none, of its terminal
    constraints), which the dynamics must keep. Like all single shooting it converges from near
    by only, where the distance cost is active: ``enumerate_extremals`` scans all ends.

    Args:
        boundary: type of the boundary conditions.
        steps: integration steps over the horizon.
        integrator: one-step method of each step.
        damped: whether Newton steps are tested and halved.
        tolerance: on the max norm of the residual.
        max_steps: limit of Newton steps in each chart of the manifold (there are five at most).

    Source: thesis 3.2.4, [Nakamura & Hanafusa 1987].
    """

    boundary: Boundary = 3
    steps: int = 300
    integrator: Integrator = field(default_factory=RK4)
    damped: bool = True
    tolerance: float = 1e-10
    max_steps: int = 50

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        check_whole(self.steps, "reverse shooting: steps")
        check_whole(self.max_steps, "reverse shooting: max_steps")
        check_instance(self.integrator, Integrator, "reverse shooting: integrator")
        if check_whole(self.boundary, "reverse shooting: boundary", least=0) not in (2, 3, 4):
            raise ProblemError(
                f"reverse shooting: boundary = {self.boundary!r}, it is 2, 3 or 4 (type 1 is "
                "IndirectShooting)"
            )
        check_positive(self.tolerance, "reverse shooting: tolerance")
        check_flag(self.damped, "reverse shooting: damped")

    def prepare(self, ocp: OCP) -> "ReverseShootingProgram":
        """Derive the canonical flow and the conditions at both ends."""
        check_instance(ocp, OCP, "reverse shooting: the problem")
        refuse_what_reverse_cannot(ocp)
        require_explicit(ocp, self.integrator, "reverse shooting")
        if self.boundary == 4 and ocp.has_free_start:
            raise UnsupportedProblem(
                f"{ocp.name}: its start is free ('{ocp.at('initial')[0].name}'), which is "
                "boundary 2 or 3, not 4"
            )
        if self.boundary != 4 and not ocp.has_free_start:
            raise UnsupportedProblem(
                f"{ocp.name}: its start is given, which is boundary 4; boundary {self.boundary} "
                "needs an initial constraint"
            )
        kept = InvariantManifold.of(ocp)
        reverse = ReverseFlow.of(ocp, self.steps, self.integrator)
        return ReverseShootingProgram(self, ocp, reverse, kept, transversality(ocp))


@dataclass(frozen=True, eq=False)
class ReverseShootingProgram(MethodProgram):
    """A problem whose end is unknown, ready for Newton."""

    solver: ReverseShooting
    reverse: ReverseFlow
    kept: InvariantManifold
    transversality: ca.Function

    def _solve(self, data: RunData, guess: InitialGuess | None) -> RunResult:
        """Solve for these data; of a guess only the final state is used.

        Without one Newton begins at the end configuration that is reached from the start by
        the shortest way.
        """
        run = _Run(self, data, ShootingSchedule.of(self.ocp, data, self.solver.steps))
        rows = guess.sample("x", np.array([1.0]), self.ocp.model.nx) if guess else None
        return run.result(data.x0 if rows is None else rows[0])


@dataclass(frozen=True, eq=False)
class _Run:
    """One run: the program, its data, and both end manifolds."""

    program: ReverseShootingProgram
    data: RunData
    schedule: ShootingSchedule

    @property
    def end(self) -> Manifold:
        t1 = self.schedule.t0 + self.schedule.duration
        return self.program.kept.at(t1, self.schedule.p_last)

    @property
    def start(self) -> Manifold:
        return self.program.kept.at(self.schedule.t0, self.schedule.p_first)

    def result(self, guess: np.ndarray) -> RunResult:
        """Find an end configuration and integrate back from it."""
        rows, arrived = self.end.projected(guess[None, :])
        if not arrived[0]:
            return self._stopped(Status.INFEASIBLE, out_of_reach(self.end, rows))
        away = float(np.abs(self.start.linearised(self.data.x0[None, :])[0]).max())
        if self.program.solver.boundary == 4 and away > _INACCURATE:
            reason = f"the start misses {self.start.name} by {away:.3g}: no motion ends on it"
            return self._stopped(Status.INFEASIBLE, reason)
        results, x1 = self._newton(rows[0])
        paths = self.program.reverse.path(x1, self.schedule)
        if not np.isfinite(paths.z).all() or not np.isfinite(paths.costs).all():
            reason = "the reverse integration blows up: it passes a singular configuration"
            return self._stopped(Status.DIVERGED, reason)
        return self._found(paths, results)

    # -- Newton ---------------------------------------------------------------------------

    def _newton(self, x1: np.ndarray) -> tuple[list[NewtonResult], np.ndarray]:
        """Solve in a chart of the end manifold, and in the next where that one ends."""
        if self.program.solver.boundary == 2:
            result = self._newton_in(lambda v: v, lambda v: np.eye(len(v)), x1)
            return [result], result.x
        results: list[NewtonResult] = []
        for _ in range(_MOST_CHARTS):
            chart = Chart.at(self.end, x1)
            zero = np.zeros(chart.tangent.shape[1])
            results.append(self._newton_in(chart.point, chart.slope, zero))
            x1 = chart.point(results[-1].x)
            if results[-1].converged or not results[-1].x.any():
                break
        return results, x1

    def _newton_in(
        self,
        point: Callable[[np.ndarray], np.ndarray],
        slope: Callable[[np.ndarray], np.ndarray],
        first: np.ndarray,
    ) -> NewtonResult:
        solver, reverse = self.program.solver, self.program.reverse

        def residual(s: np.ndarray) -> tuple[np.ndarray, SegmentTrajectories]:
            paths = reverse.path(point(s), self.schedule)
            return self._condition(paths.ends[0])[0], paths

        def linearise(s: np.ndarray, paths: SegmentTrajectories) -> Solve:
            in_start = self._condition(paths.ends[0])[1]
            jacobian = in_start @ reverse.slope(paths, self.schedule, slope(point(s)))
            if not np.isfinite(jacobian).all():
                return lambda r: np.full(len(s), np.nan)
            # More rows than unknowns, but they are consistent: a projector has rank n - m1.
            return np.linalg.pinv(jacobian).__matmul__

        return newton(
            residual,
            linearise,
            first,
            tolerance=solver.tolerance,
            max_steps=solver.max_steps,
            damped=solver.damped,
        )

    def _condition(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what must vanish at t0, and its derivative in z."""
        x, boundary = z[: len(z) // 2], self.program.solver.boundary
        if boundary == 4:
            projector = self.start.projector(self.data.x0)
            away = self.start.periods.wrapped(x - self.data.x0)
            return projector @ away, np.hstack([projector, np.zeros_like(projector)])
        value, in_z = self.program.transversality(z, self.schedule.t0, self.schedule.p_first)
        skip = len(value.full()) - len(x) if boundary == 3 else 0
        return np.array(value).ravel()[skip:], np.array(in_z)[skip:]

    # -- out ------------------------------------------------------------------------------

    def _found(self, paths: SegmentTrajectories, results: list[NewtonResult]) -> RunResult:
        ext, back = self.program.reverse.extremals, self.schedule.reversed()
        t, x, costate, u = (a[::-1] for a in ext.trajectory(paths, back, back.duration))
        terminal = ext.ocp.functions.terminal_cost(x[-1], t[-1], self.schedule.p_last)
        x = x - self.start.periods.turns(x[0] - self.data.x0)
        status, message = self._verdict(results[-1], x[0])
        return RunResult(
            status=status,
            message=message,
            t=t,
            x=x,
            costate=costate,
            u=u,
            control_kind="extremal",
            cost=float(terminal) - float(paths.costs.sum()),
            residual=results[-1].residual,
            iterations=sum(r.steps for r in results),
            work=Work(
                rollouts=sum(r.evaluations for r in results) + 1,
                jacobians=sum(r.steps for r in results),
                factorisations=sum(r.steps for r in results),
            ),
            history={"residual": np.concatenate([r.history for r in results])},
        )

    def _verdict(self, last: NewtonResult, x: np.ndarray) -> tuple[Status, str]:
        if not last.converged:
            limit = last.steps >= self.program.solver.max_steps
            return (Status.ITERATION_LIMIT if limit else Status.NO_PROGRESS), last.in_words
        away = float(np.abs(self.start.linearised(x[None, :])[0]).max())
        if self.program.solver.boundary == 4:
            away = float(np.abs(x - self.data.x0).max())
        if away > _ELSEWHERE:
            return Status.NO_PROGRESS, f"the motion found begins {away:.3g} away from the start"
        if away > _INACCURATE:
            return Status.INACCURATE, f"the integration misses the start by {away:.3g}"
        return Status.STATIONARY, ""

    def _stopped(self, status: Status, message: str) -> RunResult:
        still = self.program.reverse.extremals.still(self.data.x0, self.schedule)
        return RunResult(
            status=status,
            message=message,
            t=still.t,
            x=still.x,
            costate=still.costate,
            u=still.u,
            control_kind="extremal",
            cost=np.inf,
        )
