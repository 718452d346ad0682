"""Indirect shooting: Newton-Raphson on the minimum principle's boundary value problem."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.linalg import splu

from ocp import (
    OCP,
    RK4,
    Data,
    Integrator,
    ProblemError,
    Program,
    Solution,
    Solver,
    Start,
    Status,
    UnsupportedProblem,
    Work,
    instance,
    positive,
    whole,
)
from solvers.indirect.continuation import HorizonContinuation, ParameterContinuation
from solvers.indirect.extremal import Extremals, Paths, Schedule
from solvers.indirect.newton import NewtonResult, Solve, newton
from solvers.indirect.second_order import SecondOrder, concave_at, second_order

_SMALLEST_ADVANCE = 1e-3
# An eigenvalue of H_uu below minus this is no rounding error.
_CONCAVE = 1e-9


@dataclass(frozen=True)
class IndirectShooting(Solver):
    """Shooting on the costates; exact to the integrator's error, if Newton gets there.

    One segment is the thesis' method: Newton-Raphson on psi(t0) (3.49, 3.50). More segments
    are indirect multiple shooting, far less sensitive. A solution meets the *necessary*
    conditions: it is ``STATIONARY``, and ``polish`` tests whether it is a minimum.
    Path constraints and state bounds are refused.

    Args:
        segments: number of segments.
        steps: integration steps over the whole horizon; rounded up to fill the segments.
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

    segments: int = 1
    steps: int = 300
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
        whole(self.segments, "indirect shooting: segments")
        whole(self.steps, "indirect shooting: steps", least=self.segments)
        instance(self.integrator, Integrator, "indirect shooting: integrator")
        whole(self.max_steps, "indirect shooting: max_steps")
        positive(self.tolerance, "indirect shooting: tolerance")
        positive(self.delta, "indirect shooting: delta")
        if self.continuation is not None:
            kinds = (HorizonContinuation, ParameterContinuation)
            instance(self.continuation, kinds, "indirect shooting: continuation")
        if self.jacobian not in ("exact", "finite-difference"):
            raise ProblemError(
                f"jacobian = {self.jacobian!r} is neither exact nor finite-difference"
            )

    def build(self, ocp: OCP) -> "IndirectShootingProgram":
        """Derive the boundary value problem."""
        for c in ocp.at("path"):
            raise UnsupportedProblem(f"{ocp.name}: indirect shooting takes no path '{c.name}'")
        if ocp.state_bounds.is_active:
            raise UnsupportedProblem(f"{ocp.name}: indirect shooting takes no state bounds")
        if self.continuation:
            self.continuation.check(ocp)
        per_segment = -(-self.steps // self.segments)
        extremals = Extremals.of(
            ocp, self.segments, per_segment, self.integrator, fast=self.compiled
        )
        return IndirectShootingProgram(self, extremals)


@dataclass(frozen=True, eq=False)
class IndirectShootingProgram(Program):
    """A boundary value problem, ready for Newton."""

    solver: IndirectShooting
    extremals: Extremals

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: Start | None = None,
    ) -> Solution:
        """Solve for these data; a guess needs costates, else they start at zero."""
        started = perf_counter()
        ocp = self.extremals.ocp
        data = Data.of(ocp, x0, t0, parameters)
        start = self._first_unknowns(data, guess or ocp.guess)
        results = [self._newton(data, 1.0, start)]
        if not results[0].converged and self.solver.continuation:
            results += self._continue(data, start)
        return self._solution(data, results, perf_counter() - started)

    # -- Newton ------------------------------------------------------------------------

    def _newton(self, data: Data, share: float, v: np.ndarray) -> NewtonResult:
        schedule = self.schedule(data, share)
        return newton(
            lambda v: self.extremals.residual(v, schedule, data.x0),
            lambda v, paths: self._linearise(v, paths, schedule, data.x0),
            v,
            tolerance=self.solver.tolerance,
            max_steps=self.solver.max_steps,
            damped=self.solver.damped,
        )

    def _linearise(self, v: np.ndarray, paths: Paths, schedule: Schedule, x0: np.ndarray) -> Solve:
        slopes = self._slopes(v, paths, schedule)
        jacobian = self.extremals.jacobian(v, paths, schedule, x0, slopes)
        return _factorised(jacobian)

    def _slopes(
        self, v: np.ndarray, paths: Paths, schedule: Schedule
    ) -> tuple[np.ndarray, np.ndarray]:
        z, _, _, duration = self.extremals.shape.split(v, schedule.duration)
        if self.solver.jacobian == "exact":
            return self.extremals.segment_slopes(paths, schedule, duration)
        delta, size = self.solver.delta, z.shape[1]
        in_z = np.zeros((len(z), size, size))
        for i in self._varied:
            moved = self.extremals.paths(z + delta * np.eye(size)[i], schedule, duration)
            in_z[:, :, i] = (moved.ends - paths.ends) / delta
        in_time = np.zeros_like(z)
        if self.extremals.shape.free_time:
            in_time = (
                self.extremals.paths(z, schedule, duration + delta).ends - paths.ends
            ) / delta
        return in_z, in_time

    @property
    def _varied(self) -> range:
        """Components of z to vary: with one segment and a given start only the costates."""
        nx = self.extremals.shape.nx
        fixed = self.extremals.shape.segments == 1 and not self.extremals.ocp.has_free_start
        return range(nx if fixed else 0, 2 * nx)

    def _continue(self, data: Data, v: np.ndarray) -> Iterator[NewtonResult]:
        """Advance the continuation, doubling steps that succeed and halving those that fail."""
        continuation = self.solver.continuation
        assert continuation is not None
        reached, advance = 0.0, continuation.first or 0.5
        share = continuation.first
        while True:
            result = self._newton(*continuation.applied(data, share), v)
            if result.converged:
                yield result
                if share >= 1.0:
                    return
                v, reached, advance = result.x, share, 2.0 * advance
            else:
                advance /= 4.0 if reached else 2.0
                yield result
                if advance < _SMALLEST_ADVANCE:
                    return
            share = min(1.0, reached + advance)

    def second_order(self, solution: Solution) -> SecondOrder:
        """Test whether an extremal that this program found is a minimum."""
        schedule = self.schedule(solution.data)
        v = self._first_unknowns(solution.data, solution)
        z, _, _, duration = self.extremals.shape.split(v, schedule.duration)
        return second_order(
            self.extremals, v, schedule, self.extremals.paths(z, schedule, duration)
        )

    # -- in and out -----------------------------------------------------------------------

    def schedule(self, data: Data, share: float = 1.0) -> Schedule:
        """Return the integration grid of a run."""
        ext = self.extremals
        return Schedule.of(ext.ocp, data, ext.shape.segments * ext.steps, share)

    def _first_unknowns(self, data: Data, guess: Start | None) -> np.ndarray:
        shape, ocp = self.extremals.shape, self.extremals.ocp
        nodes = np.linspace(0.0, 1.0, shape.segments + 1)
        x = guess.sample("x", nodes, shape.nx) if guess else None
        costate = guess.sample("costate", nodes, shape.nx) if guess else None
        duration = (guess.duration if guess else None) or ocp.duration
        x = np.tile(data.x0, (len(nodes), 1)) if x is None else x
        if not ocp.has_free_start:
            x = np.vstack([data.x0, x[1:]])
        costate = np.zeros_like(x) if costate is None else costate
        z = np.hstack([x, costate])
        mu, nu = self._first_multipliers(z, data, duration)
        return shape.join(z[:-1], mu, nu, duration)

    def _first_multipliers(
        self, z: np.ndarray, data: Data, duration: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the multipliers that best balance the guessed costates at both ends."""
        ext, nx = self.extremals, self.extremals.shape.nx
        schedule = self.schedule(data)
        mu, nu = np.zeros(ext.shape.n_mu), np.zeros(ext.shape.n_nu)
        value, _, in_mu = (np.array(a) for a in ext.starts(z[0], mu, data.t0, schedule.p_first))
        mu = -np.linalg.lstsq(in_mu[-nx:], value[-nx:].ravel(), rcond=None)[0]
        t = data.t0 + duration
        value, _, in_nu, _ = (np.array(a) for a in ext.ends(z[-1], nu, t, schedule.p_last))
        nu = -np.linalg.lstsq(in_nu[:nx], value[:nx].ravel(), rcond=None)[0]
        return mu, nu

    def _solution(self, data: Data, results: list[NewtonResult], seconds: float) -> Solution:
        ext, last = self.extremals, results[-1]
        schedule = self.schedule(data)
        z, _, _, duration = ext.shape.split(last.x, schedule.duration)
        paths = ext.paths(z, schedule, duration)
        t, x, costate, u = ext.trajectory(paths, schedule, duration)
        cost = float(paths.costs.sum()) + float(
            ext.ocp.functions.terminal_cost(x[-1], t[-1], schedule.p_last)
        )
        status, message = self._verdict(results)
        if not all(np.isfinite(a).all() for a in (t, x, costate, u, cost)) or duration <= 0.0:
            status = Status.DIVERGED
            message = message or "the cost is not finite along the extremal"
            t, x, costate, u = ext.still(data.x0, schedule)
            cost = np.inf
        elif status is Status.STATIONARY and ext.ocp.time_box.excess(np.array([duration]))[0] > 0.0:
            status = Status.FAILED
            message = (
                f"the stationary final time, {duration:.4g} s, is outside its bounds, which "
                "this method does not impose: use a direct method"
            )
        elif status is Status.STATIONARY:
            concave = concave_at(ext, paths, schedule, duration, below=-_CONCAVE)
            if concave is not None:
                status = Status.FAILED
                message = f"the control is no minimum of the Hamiltonian at t = {concave:.4g} s"
        return Solution(
            problem=ext.ocp,
            solver=repr(self.solver),
            status=status,
            message=message,
            t=t,
            x=x,
            x0=data.x0,
            costate=costate,
            u=u,
            control_kind="extremal",
            cost=cost,
            residual=last.residual,
            iterations=sum(r.steps for r in results),
            work=self._work(results),
            history={"residual": last.history},
            parameters=data.values.as_dict(),
            solve_time=seconds,
        )

    def _verdict(self, results: list[NewtonResult]) -> tuple[Status, str]:
        last = results[-1]
        if last.converged:
            return Status.STATIONARY, ""
        message = f"residual {last.residual:.3g} after {last.steps} Newton steps"
        if last.diverged:
            return Status.DIVERGED, message
        if last.steps >= self.solver.max_steps:
            return Status.ITERATION_LIMIT, message
        return Status.NO_PROGRESS, message

    def _work(self, results: list[NewtonResult]) -> Work:
        steps, evaluations = sum(r.steps for r in results), sum(r.evaluations for r in results)
        if self.solver.jacobian == "exact":
            return Work(rollouts=evaluations, jacobians=steps, factorisations=steps)
        columns = len(self._varied) + int(self.extremals.shape.free_time)
        return Work(rollouts=evaluations + columns * steps, factorisations=steps)


def _factorised(jacobian: sparse.csc_matrix) -> Callable[[np.ndarray], np.ndarray]:
    """Return the solve with a sparse LU factorisation; NaN if there is none."""
    if not np.isfinite(jacobian.data).all():
        return lambda r: np.full_like(r, np.nan)
    try:
        return splu(jacobian).solve
    except RuntimeError:  # SuperLU: the factor is exactly singular
        return lambda r: np.full_like(r, np.nan)
