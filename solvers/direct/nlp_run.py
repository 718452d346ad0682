"""From a first iterate to a verdict: what every direct method does around its backend."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ocp import Status, Work
from ocp.internal import ConstraintRow, RunData, start_violation
from solvers.direct.feasibility_restoration import FeasibilityRestoration
from solvers.direct.nlp_backends import Nlp, NlpBackend, NlpResult
from solvers.direct.transcribed_problem import TranscribedProblem

# Beyond this a constraint counts as violated, whatever the backend says about scaled ones.
_VIOLATED = 1e-6
# How far a backend that did not move is pushed, relative to 1 + abs(u).
_KICK = 1e-3
# What counts as not moving, by the same measure.
_SAME = 1e-6
# What the elastic problem leaves over beyond its own tolerance.
_UNAVOIDABLE = 1e-5


@dataclass(frozen=True, eq=False)
class NlpOutcome:
    """How a search ended.

    Attributes:
        answers: of every run of a backend; the last one is the result.
        status: the verdict.
        message: what and where.
    """

    answers: tuple[NlpResult, ...]
    status: Status
    message: str

    @property
    def last(self) -> NlpResult:
        """The result."""
        return self.answers[-1]

    @property
    def iterations(self) -> int:
        """Iterations of all runs."""
        return sum(answer.count for answer in self.answers)

    @property
    def work(self) -> Work:
        """Work of all runs."""
        return sum((answer.work for answer in self.answers), Work())

    def history(self) -> dict[str, np.ndarray]:
        """Return cost, infeasibility and residual of each iteration of the last run."""
        names = {"cost": "obj", "infeasibility": "inf_pr", "residual": "inf_du"}
        return {name: self.last.history(own) for name, own in names.items()}

    @property
    def residual(self) -> float:
        """The last dual infeasibility."""
        values = self.last.history("inf_du")
        return float(values[-1]) if values.size else 0.0


@dataclass(frozen=True, eq=False)
class NlpRun:
    """Solve; leave a stationary start; where that fails, look for a feasible trajectory.

    Attributes:
        transcription: the problem on its grid.
        options: of the backend.
        accuracy: the largest accepted error of a state.
        error: (answer, data) -> error of a state relative to 1 + abs(x), and at which instant.
        feasibility_restoration: whether a failure is followed by a search for the least
            violating trajectory.
    """

    transcription: TranscribedProblem
    options: NlpBackend
    accuracy: float
    error: Callable[[NlpResult, RunData], tuple[float, int]]
    feasibility_restoration: bool = True

    @cached_property
    def nlp(self) -> Nlp:
        """The backend, set up."""
        return self.options.build(self.transcription)

    @cached_property
    def _feasibility(self) -> FeasibilityRestoration:
        return FeasibilityRestoration(self.transcription, self.options.time_limit)

    def solve(self, w0: np.ndarray, data: RunData) -> NlpOutcome:
        """Solve for these data from a first iterate, which is clipped to the bounds."""
        ocp, bounds = self.transcription.ocp, self.transcription.bounds(data)
        p = self.transcription.data_vector(data)
        w0 = np.clip(w0, bounds["lbx"], bounds["ubx"])
        answers = [self.nlp.solve(w0, p, bounds)]
        status, message = self._verdict(answers[-1], data, bounds)
        if status is Status.SOLVED and not self._moved(w0, answers[-1]):
            # A backend looks at curvature only where it goes: one that stays on its first
            # controls takes a maximum or a saddle there for a solution. From a minimum the
            # second run comes back at once.
            second = self.nlp.solve(self._kicked(answers[-1], bounds), p, bounds)
            if second.is_lost:
                answers.insert(0, second)
                status, message = Status.STATIONARY, f"from beside it, {self._lost(second)}"
            else:
                answers.append(second)
                status, message = self._verdict(second, data, bounds)
        constrained = bool(ocp.constraints) or ocp.state_bounds.is_active
        if self.feasibility_restoration and constrained and status in _MAYBE_INFEASIBLE:
            found = self._feasibility.least_violating(w0, bounds, p)
            if found:
                answers.append(found[0])
                status, message = Status.INFEASIBLE, self._where(found[0], data, *found[1:])
            if found and found[1] <= _UNAVOIDABLE:
                answers.append(self.nlp.solve(found[0].w, p, bounds))
                status, message = self._verdict(answers[-1], data, bounds)
        return NlpOutcome(tuple(answers), status, message)

    def _moved(self, w0: np.ndarray, answer: NlpResult) -> bool:
        """Whether any control differs from the first iterate's."""
        before, after = (w[self.transcription.is_control] for w in (w0, answer.w))
        return bool(np.any(np.abs(after - before) > _SAME * (1.0 + np.abs(before))))

    def _kicked(self, answer: NlpResult, bounds: dict[str, np.ndarray]) -> np.ndarray:
        """Return the unknowns with slightly different controls; the same for the same answer."""
        w, at = answer.w.copy(), self.transcription.is_control
        u = w[at]
        w[at] += _KICK * np.random.default_rng(0).normal(size=u.shape) * (1.0 + np.abs(u))
        return np.clip(w, bounds["lbx"], bounds["ubx"])

    # -- the verdict -------------------------------------------------------------------------

    def _verdict(
        self, answer: NlpResult, data: RunData, bounds: dict[str, np.ndarray]
    ) -> tuple[Status, str]:
        """Status from the backend's word, the constraints themselves and the integrator."""
        if answer.is_lost:
            return Status.FAILED, self._lost(answer)
        if not np.isfinite(answer.cost):
            return Status.DIVERGED, f"the backend met a number that is not finite ({answer.word})"
        violation, row = self.transcription.worst(answer.w, answer.g, bounds)
        violated = violation > _VIOLATED
        where = self._where(answer, data, violation, row) if violated else ""
        if answer.success and not violated:
            if fault := start_violation(self.transcription.ocp, data):
                return Status.INFEASIBLE, fault
            error, node = self.error(answer, data)
            if error <= self.accuracy:
                return Status.SOLVED, ""
            t = self.times(answer, data)[node]
            return Status.INACCURATE, f"a state moves by {error:.2g} at t = {t:.4g} s"
        if answer.count >= self.options.max_iterations:
            return Status.ITERATION_LIMIT, where
        if answer.word == "Maximum_WallTime_Exceeded":
            return Status.TIME_LIMIT, where
        if answer.word == "Diverging_Iterates":
            return Status.DIVERGED, where or "the cost may be unbounded below"
        return Status.FAILED, f"{self.options.name} says {answer.word}. {where}".strip()

    def _lost(self, answer: NlpResult) -> str:
        return f"{self.options.name} {answer.word}"

    def _where(
        self, answer: NlpResult, data: RunData, violation: float, row: ConstraintRow | None
    ) -> str:
        if row is None:
            return ""
        t = self.times(answer, data)[row.node]
        return f"'{row.name}' is violated by {violation:.3g} at t = {t:.4g} s"

    def times(self, answer: NlpResult, data: RunData) -> np.ndarray:
        """Return the instants of the grid [s]."""
        duration = self.transcription.duration(answer.w)
        return data.t0 + self.transcription.fractions * duration


# An optimiser that cannot meet a constraint may also exploit the integrator's error to do so.
_MAYBE_INFEASIBLE = (
    Status.ITERATION_LIMIT,
    Status.TIME_LIMIT,
    Status.FAILED,
    Status.INACCURATE,
)
