"""Indirect shooting: Newton-Raphson on the minimum principle's boundary value problem."""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import numpy as np

from ocp import (
    OCP,
    RK4,
    Grid,
    InitialGuess,
    Integrator,
    ProblemError,
    Solution,
    UnsupportedProblem,
    Work,
)
from ocp.internal import (
    MethodProgram,
    RunData,
    RunResult,
    ScalingSolver,
    check_choice,
    check_flag,
    check_instance,
    check_intervals,
    check_positive,
    check_whole,
    number_of,
    refuse_compiled,
    refuse_state_bounds,
    require_explicit,
)
from solvers.indirect.boundary_value_problem import ExtremalProblem
from solvers.indirect.continuation import HorizonContinuation, ParameterContinuation, advanced
from solvers.indirect.finite_difference_sensitivities import perturbed_slopes, varied
from solvers.indirect.first_guess import first_unknowns
from solvers.indirect.newton_iteration import NewtonResult, Solve, newton
from solvers.indirect.newton_system import factorised
from solvers.indirect.newton_verdict import ExtremalMotion, verdict
from solvers.indirect.second_order import SecondOrder, second_order
from solvers.indirect.shooting_segments import SegmentTrajectories, ShootingSchedule


@dataclass(frozen=True)
class IndirectShooting(ScalingSolver):
    """Shooting on the costates; exact to the integrator's error, if Newton gets there.

    One segment is the thesis' method: Newton-Raphson on psi(t0) (3.49, 3.50). More segments
    are indirect multiple shooting, far less sensitive. A solution meets the *necessary*
    conditions: it is ``STATIONARY``, and ``polish`` tests whether it is a minimum.
    Path constraints and state bounds are refused.

    Args:
        segments: number of segments.
        steps: integration steps over the whole horizon; rounded up to fill the segments. Or a
            ``Grid`` of them, which the segments share out equally by number.
        integrator: one-step method of each step.
        jacobian: ``"exact"``, by CasADi along the trajectory, or ``"finite-difference"``,
            the thesis' Algorithm 1, for comparison.
        delta: variation of Algorithm 1.
        damped: whether Newton steps are tested and halved; False is (3.50) as it stands.
        continuation: what to do when Newton fails from the guess.
        tolerance: on the max norm of the boundary value problem's residual.
        max_steps: limit of Newton steps (of each problem in a continuation).
        compiled: run the steps as machine code; the first build takes seconds, see ``compiled``.
    """

    takes_phases: ClassVar[bool] = True

    segments: int = 1
    steps: int | Grid = 300
    integrator: Integrator = field(default_factory=RK4)
    jacobian: Literal["exact", "finite-difference"] = "exact"
    delta: float = 1e-6
    damped: bool = True
    continuation: HorizonContinuation | ParameterContinuation | None = None
    tolerance: float = 1e-10
    max_steps: int = 50
    compiled: bool = False

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        check_whole(self.segments, "indirect shooting: segments")
        check_intervals(self.steps, "indirect shooting: steps", least=self.segments)
        if isinstance(self.steps, Grid) and self.steps.intervals % self.segments:
            raise ProblemError(
                f"indirect shooting: the {self.steps.intervals} steps of the grid are no multiple "
                f"of the {self.segments} segments"
            )
        check_instance(self.integrator, Integrator, "indirect shooting: integrator")
        check_whole(self.max_steps, "indirect shooting: max_steps")
        check_positive(self.tolerance, "indirect shooting: tolerance")
        check_positive(self.delta, "indirect shooting: delta")
        if self.continuation is not None:
            kinds = (HorizonContinuation, ParameterContinuation)
            check_instance(self.continuation, kinds, "indirect shooting: continuation")
        check_choice(self.jacobian, ("exact", "finite-difference"), "indirect shooting: jacobian")
        check_flag(self.damped, "indirect shooting: damped")
        check_flag(self.compiled, "indirect shooting: compiled")

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "IndirectShooting":
        """Set what is left open; see ``Solver``."""
        return replace(self, compiled=compiled or self.compiled, judged=False)

    def prepare(self, ocp: OCP) -> "IndirectShootingProgram":
        """Derive the boundary value problem."""
        check_instance(ocp, OCP, "indirect shooting: the problem")
        for c in ocp.at("path"):
            raise UnsupportedProblem(
                f"{ocp.name}: indirect shooting takes no path constraint ('{c.name}')"
            )
        refuse_state_bounds(ocp, "indirect shooting")
        refuse_compiled(ocp, compiled=self.compiled)
        require_explicit(ocp, self.integrator, "indirect shooting")
        if self.continuation:
            self.continuation.check(ocp)
        per_segment = -(-number_of(self.steps) // self.segments)
        extremals = ExtremalProblem.of(
            ocp, self.segments, per_segment, self.integrator, fast=self.compiled
        )
        return IndirectShootingProgram(self, ocp, extremals)


@dataclass(frozen=True, eq=False)
class IndirectShootingProgram(MethodProgram):
    """A boundary value problem, ready for Newton."""

    solver: IndirectShooting
    extremals: ExtremalProblem

    def _solve(self, data: RunData, guess: InitialGuess | None) -> RunResult:
        """Solve for these data; a guess needs costates, else they start at zero."""
        v = first_unknowns(self.extremals, data, self.schedule(data), guess)
        results = [self._newton(data, 1.0, v)]
        if not results[0].converged and self.solver.continuation:
            results += advanced(self.solver.continuation, data, v, self._newton)
        return self._result(data, results)

    def second_order(self, solution: Solution) -> SecondOrder:
        """Test whether an extremal that this program found is a minimum."""
        schedule = self.schedule(solution.data)
        v = first_unknowns(self.extremals, solution.data, schedule, solution)
        at = self.extremals.shape.split(v, schedule.duration)
        paths = self.extremals.paths(at.z, schedule, at.duration)
        return second_order(self.extremals, v, schedule, paths)

    def schedule(self, data: RunData, share: float = 1.0) -> ShootingSchedule:
        """Return the integration grid of a run."""
        ext, steps = self.extremals, self.solver.steps
        if not isinstance(steps, Grid):
            steps = ext.shape.segments * ext.steps
        return ShootingSchedule.of(ext.ocp, data, steps, share)

    # -- Newton ------------------------------------------------------------------------

    def _newton(self, data: RunData, share: float, v: np.ndarray) -> NewtonResult:
        """Iterate (3.50) from ``v``, on a share of the horizon."""
        schedule = self.schedule(data, share)
        return newton(
            lambda v: self.extremals.residual(v, schedule, data.x0),
            lambda v, paths: self._linearised(v, paths, schedule, data.x0),
            v,
            tolerance=self.solver.tolerance,
            max_steps=self.solver.max_steps,
            damped=self.solver.damped,
        )

    def _linearised(
        self, v: np.ndarray, paths: SegmentTrajectories, schedule: ShootingSchedule, x0: np.ndarray
    ) -> Solve:
        slopes = self._slopes(v, paths, schedule)
        return factorised(self.extremals.jacobian(v, paths, schedule, x0, slopes))

    def _slopes(
        self, v: np.ndarray, paths: SegmentTrajectories, schedule: ShootingSchedule
    ) -> tuple[np.ndarray, np.ndarray]:
        ext = self.extremals
        at = ext.shape.split(v, schedule.duration)
        if self.solver.jacobian == "exact":
            return ext.segment_slopes(paths, schedule, at.duration)
        return perturbed_slopes(ext, at.z, paths, schedule, at.duration, self.solver.delta)

    # -- out ---------------------------------------------------------------------------

    def _result(self, data: RunData, results: list[NewtonResult]) -> RunResult:
        ext, last, schedule = self.extremals, results[-1], self.schedule(data)
        motion = ExtremalMotion.of(ext, last.x, schedule)
        status, message = verdict(ext, motion, schedule, last, self.solver.max_steps)
        shown = motion if motion.exists else ext.still(data.x0, schedule)
        return RunResult(
            status=status,
            message=message,
            t=shown.t,
            x=shown.x,
            costate=shown.costate,
            u=shown.u,
            control_kind="extremal",
            cost=motion.cost if motion.exists else np.inf,
            residual=last.residual,
            iterations=sum(r.steps for r in results),
            work=self._work(results),
            history={"residual": last.history},
        )

    def _work(self, results: list[NewtonResult]) -> Work:
        steps, evaluations = sum(r.steps for r in results), sum(r.evaluations for r in results)
        if self.solver.jacobian == "exact":
            return Work(rollouts=evaluations, jacobians=steps, factorisations=steps)
        columns = len(varied(self.extremals)) + int(self.extremals.shape.free_time)
        return Work(rollouts=evaluations + columns * steps, factorisations=steps)
