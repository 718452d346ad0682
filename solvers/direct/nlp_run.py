"""How a direct method solves its nonlinear program: up to four phases around a backend.

``NlpRun.solve`` names them: solve from the first iterate; solve again from perturbed controls if
the backend did not move; restore feasibility if it failed; solve again from there. Each phase
returns an ``NlpOutcome``, or the trajectory that violates the constraints least.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ocp import Status, Work
from ocp.internal import ConstraintRow, RunData, Violation, start_violation
from solvers.direct.feasibility_restoration import FeasibilityRestoration, LeastViolation
from solvers.direct.nlp_backends import Nlp, NlpResult
from solvers.direct.transcribed_problem import TranscribedProblem

# Constraint violations above this count, also if the backend accepts them after scaling.
_VIOLATED = 1e-6
# Standard deviation of the perturbation of the controls, relative to 1 + abs(u).
_PERTURBATION = 1e-3
# Changes of the controls below this, relative to 1 + abs(u), count as none.
_UNCHANGED = 1e-6
# A least violation up to this counts as feasible: the elastic problem is solved to its tolerance.
_FEASIBLE = 1e-5
# Failures that an infeasible problem may cause. INACCURATE is one of them: to meet a constraint
# that cannot be met an optimiser may exploit the integrator's error.
_MAYBE_INFEASIBLE = (
    Status.ITERATION_LIMIT,
    Status.TIME_LIMIT,
    Status.FAILED,
    Status.INACCURATE,
)


@dataclass(frozen=True, eq=False)
class NlpOutcome:
    """How the phases so far have ended.

    Attributes:
        results: of every run of a backend; the last one is returned to the user.
        status: how it ended.
        message: what went wrong, and when on the horizon.
    """

    results: tuple[NlpResult, ...]
    status: Status
    message: str

    @property
    def last(self) -> NlpResult:
        """The result that counts."""
        return self.results[-1]

    @property
    def iterations(self) -> int:
        """Iterations of all runs."""
        return sum(result.iterations for result in self.results)

    @property
    def work(self) -> Work:
        """Work of all runs."""
        return sum((result.work for result in self.results), Work())

    def history(self) -> dict[str, np.ndarray]:
        """Return cost, infeasibility and residual of each iteration of the last run."""
        names = {"cost": "obj", "infeasibility": "inf_pr", "residual": "inf_du"}
        return {name: self.last.history(own) for name, own in names.items()}

    @property
    def residual(self) -> float:
        """The last dual infeasibility; 0 where the backend records none."""
        values = self.last.history("inf_du")
        return float(values[-1]) if values.size else 0.0


@dataclass(frozen=True, eq=False)
class _Inputs:
    """The inputs of one solve: first iterate w0 within its bounds, p, bounds; ``data`` as given."""

    w0: np.ndarray
    p: np.ndarray
    bounds: dict[str, np.ndarray]
    data: RunData


@dataclass(frozen=True, eq=False)
class NlpRun:
    """The phases around a backend.

    Attributes:
        transcription: the problem on its grid.
        nlp: the backend, set up for it.
        accuracy: the largest accepted error of a state, relative to 1 + abs(x).
        state_error: (result, data) -> the largest such error, and the node where it occurs.
        feasibility_restoration: whether a failure is followed by a search for the least
            violating trajectory.
    """

    transcription: TranscribedProblem
    nlp: Nlp
    accuracy: float
    state_error: Callable[[NlpResult, RunData], tuple[float, int]]
    feasibility_restoration: bool = True

    def solve(self, w0: np.ndarray, data: RunData) -> NlpOutcome:
        """Solve for these data from a first iterate, which is clipped to the bounds."""
        inputs = self._inputs(w0, data)
        outcome = self.first_solve(inputs)
        if outcome.status is Status.SOLVED and not self._has_moved(inputs.w0, outcome.last.w):
            outcome = self.solve_from_perturbed(inputs, outcome)
        if not self._may_be_infeasible(outcome):
            return outcome
        least = self.restore_feasibility(inputs)
        if least is None:
            return outcome
        if least.violation <= _FEASIBLE:
            return self.resolve(inputs, outcome, least)
        return self._infeasible(inputs, outcome, least)

    # -- the phases ------------------------------------------------------------------------------

    def first_solve(self, inputs: _Inputs) -> NlpOutcome:
        """Run the backend from the first iterate."""
        return self._run(inputs, inputs.w0, ())

    def solve_from_perturbed(self, inputs: _Inputs, first: NlpOutcome) -> NlpOutcome:
        """Run the backend from a perturbation of its result.

        A backend tests curvature along its steps only: one that makes none accepts a maximum or
        a saddle as well. From a minimum the second run returns at once.
        """
        w = self._perturbed(first.last.w, inputs.bounds)
        second = self.nlp.solve(w, inputs.p, inputs.bounds)
        if second.is_lost:
            message = f"from perturbed controls, {self._lost(second)}"
            return NlpOutcome((second, *first.results), Status.STATIONARY, message)
        return NlpOutcome((*first.results, second), *self._judge(inputs, second))

    def restore_feasibility(self, inputs: _Inputs) -> LeastViolation | None:
        """Find the least violating trajectory near the first iterate; None if that fails."""
        return self._restoration.least_violating(inputs.w0, inputs.bounds, inputs.p)

    def resolve(self, inputs: _Inputs, failed: NlpOutcome, least: LeastViolation) -> NlpOutcome:
        """Run the backend again, from a feasible trajectory."""
        return self._run(inputs, least.result.w, (*failed.results, least.result))

    # -- when to enter a phase -------------------------------------------------------------------

    def _has_moved(self, w0: np.ndarray, w: np.ndarray) -> bool:
        """Whether any control differs from the first iterate's."""
        before, after = (each[self.transcription.is_control] for each in (w0, w))
        return bool(np.any(np.abs(after - before) > _UNCHANGED * (1.0 + np.abs(before))))

    def _may_be_infeasible(self, outcome: NlpOutcome) -> bool:
        ocp = self.transcription.ocp
        is_constrained = bool(ocp.constraints) or ocp.state_bounds.is_active
        return (
            self.feasibility_restoration and is_constrained and outcome.status in _MAYBE_INFEASIBLE
        )

    # -- what the phases use ---------------------------------------------------------------------

    @cached_property
    def _restoration(self) -> FeasibilityRestoration:
        return FeasibilityRestoration(self.transcription, self.nlp.backend.time_limit)

    def _inputs(self, w0: np.ndarray, data: RunData) -> _Inputs:
        bounds = self.transcription.bounds(data)
        w0 = np.clip(w0, bounds["lbx"], bounds["ubx"])
        return _Inputs(w0, self.transcription.data_vector(data), bounds, data)

    def _run(self, inputs: _Inputs, w: np.ndarray, earlier: tuple[NlpResult, ...]) -> NlpOutcome:
        """Run the backend from an iterate, after earlier runs."""
        result = self.nlp.solve(w, inputs.p, inputs.bounds)
        return NlpOutcome((*earlier, result), *self._judge(inputs, result))

    def _perturbed(self, w: np.ndarray, bounds: dict[str, np.ndarray]) -> np.ndarray:
        """Return unknowns with slightly different controls; the same for the same unknowns."""
        w, at = w.copy(), self.transcription.is_control
        u = w[at]
        w[at] += _PERTURBATION * np.random.default_rng(0).normal(size=u.shape) * (1.0 + np.abs(u))
        return np.clip(w, bounds["lbx"], bounds["ubx"])

    # -- status and message ----------------------------------------------------------------------

    def _judge(self, inputs: _Inputs, result: NlpResult) -> tuple[Status, str]:
        """Status and message, from the backend's status, the constraints and the integrator."""
        if result.is_lost:
            return Status.FAILED, self._lost(result)
        if not np.isfinite(result.cost):
            status = result.return_status
            return Status.DIVERGED, f"the backend met a number that is not finite ({status})"
        violation, row = self.transcription.worst(result.w, result.g, inputs.bounds)
        is_violated = violation > _VIOLATED
        if result.success and not is_violated:
            return self._judge_solution(inputs, result)
        where = self._where(result, inputs.data, violation, row) if is_violated else ""
        return self._judge_failure(result, where)

    def _judge_solution(self, inputs: _Inputs, result: NlpResult) -> tuple[Status, str]:
        """Status of a result that meets the constraints."""
        if message := start_violation(self.transcription.ocp, inputs.data):
            return Status.INFEASIBLE, message
        error, node = self.state_error(result, inputs.data)
        if error <= self.accuracy:
            return Status.SOLVED, ""
        t = self.times(result, inputs.data)[node]
        return Status.INACCURATE, f"a state moves by {error:.2g} at t = {t:.4g} s"

    def _judge_failure(self, result: NlpResult, where: str) -> tuple[Status, str]:
        """Status of a result that the backend or a constraint rejects."""
        backend, return_status = self.nlp.backend, result.return_status
        if result.iterations >= backend.max_iterations:
            return Status.ITERATION_LIMIT, where
        if return_status == "Maximum_WallTime_Exceeded":
            return Status.TIME_LIMIT, where
        if return_status == "Diverging_Iterates":
            return Status.DIVERGED, where or "the cost may be unbounded below"
        return Status.FAILED, f"{backend.name} says {return_status}. {where}".strip()

    def _infeasible(self, inputs: _Inputs, failed: NlpOutcome, least: LeastViolation) -> NlpOutcome:
        """Return the least violating trajectory, and what it violates."""
        message = self._where(least.result, inputs.data, least.violation, least.row)
        return NlpOutcome((*failed.results, least.result), Status.INFEASIBLE, message)

    def _lost(self, result: NlpResult) -> str:
        return f"{self.nlp.backend.name} {result.return_status}"

    def _where(
        self, result: NlpResult, data: RunData, violation: float, row: ConstraintRow | None
    ) -> str:
        """Return what is violated, by how much and when."""
        if row is None:
            return ""
        t = self.times(result, data)[row.node]
        return str(Violation(violation, row, t))

    def times(self, result: NlpResult, data: RunData) -> np.ndarray:
        """Return the instants of the grid [s]."""
        duration = self.transcription.duration(result.w)
        return data.t0 + self.transcription.fractions * duration
