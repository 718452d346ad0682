"""Status and message of what a backend returned, judged by the answer and not by its word."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ocp import Status
from ocp.internal import ConstraintRow, RunData, Violation, start_violation
from solvers.direct.nlp_backends import Nlp
from solvers.direct.nlp_result import NlpResult
from solvers.direct.return_words import ACCEPTABLE, meaning
from solvers.direct.transcribed_problem import TranscribedProblem
from solvers.direct.warm_start import WarmStart

# Constraint violations above this count, also if the backend accepts them after scaling.
VIOLATED = 1e-6
# Where a backend has not met its tolerance, residuals below this are accepted, and reported.
_ACCEPTABLE = 5e-4
# A success with a residual above this was one only after the backend's scaling.
NOT_STATIONARY = 1e-4
# Unknowns beyond this have diverged.
_DIVERGED = 1e15


@dataclass(frozen=True, eq=False)
class NlpInputs:
    """The inputs of one solve.

    Attributes:
        w0: first iterate within its bounds.
        p: data of the program.
        bounds: lbx, ubx, lbg, ubg.
        data: as given.
        warm: what is known of the first iterate beside; None: nothing.
    """

    w0: np.ndarray
    p: np.ndarray
    bounds: dict[str, np.ndarray]
    data: RunData
    warm: WarmStart | None = None


class JudgedResult(NamedTuple):
    """A result with what it is worth."""

    result: NlpResult
    status: Status
    message: str


@dataclass(frozen=True, eq=False)
class NlpVerdict:
    """Judges results of a backend.

    A result counts as an optimum where constraints and first-order conditions hold without the
    backend's scaling. Where the backend stopped before its tolerance was met, a residual up to
    5e-4 is accepted, see ``Nlp.judged``, and the message reports it.

    Attributes:
        transcription: the problem on its grid.
        nlp: the backend, set up for it.
        accuracy: the largest accepted error of a state, relative to 1 + abs(x).
        state_error: (result, data) -> the largest such error, and the node where it occurs.
    """

    transcription: TranscribedProblem
    nlp: Nlp
    accuracy: float
    state_error: Callable[[NlpResult, RunData], tuple[float, int]]

    def judge(self, inputs: NlpInputs, result: NlpResult) -> JudgedResult:
        """Return the result, with multipliers of its own where it is accepted, and its status."""
        backend = self.nlp.backend
        if result.is_lost:
            return JudgedResult(result, Status.FAILED, f"{backend.name} {result.return_status}")
        if not np.isfinite(result.cost):
            said = meaning(backend.name, result.return_status).sentence
            message = f"{backend.name} met a number that is not finite: {said}"
            return JudgedResult(result, Status.DIVERGED, message)
        if result.is_undefined:  # cost and constraints may be those of no iterate at all
            return JudgedResult(result, *self._judge_failure(result, ""))
        violation, row = self.transcription.worst(result.w, result.g, inputs.bounds)
        if violation > VIOLATED:
            where = self.where(result, inputs.data, violation, row)
            return JudgedResult(result, *self._judge_failure(result, where))
        if not result.success or result.return_status == ACCEPTABLE:
            return self._judge_unfinished(inputs, result)
        residual = self.nlp.optimality(result, inputs.p, inputs.bounds)
        if residual.is_stationary(NOT_STATIONARY):
            return JudgedResult(result, *self._judge_solution(inputs, result, ""))
        said = f"{residual.gradient:.2g}, with multipliers up to {residual.multiplier:.2g}"
        message = f"no optimum: the gradient of the Lagrangian is {said}"
        return JudgedResult(result, Status.FAILED, message)

    def _judge_unfinished(self, inputs: NlpInputs, result: NlpResult) -> JudgedResult:
        """Accept a result that meets the constraints but not the backend's tolerance, or not."""
        fitted = self.nlp.judged(result, inputs.p, inputs.bounds)
        if fitted.residual is None or fitted.residual > _ACCEPTABLE:
            return JudgedResult(result, *self._judge_failure(result, ""))
        said = f"to an acceptable level: residual {fitted.residual:.1g}"
        return JudgedResult(fitted, *self._judge_solution(inputs, fitted, said))

    def _judge_solution(
        self, inputs: NlpInputs, result: NlpResult, level: str
    ) -> tuple[Status, str]:
        """Status of a result that meets constraints and first-order conditions."""
        if message := start_violation(self.transcription.ocp, inputs.data):
            return Status.INFEASIBLE, message
        error, node = self.state_error(result, inputs.data)
        if error <= self.accuracy:
            return Status.SOLVED, level
        t = self.times(result, inputs.data)[node]
        return Status.INACCURATE, f"a state moves by {error:.2g} at t = {t:.4g} s"

    def _judge_failure(self, result: NlpResult, where: str) -> tuple[Status, str]:
        """Status of a result that the backend or a constraint rejects."""
        backend = self.nlp.backend
        word = meaning(backend.name, result.return_status)
        if result.iterations >= backend.max_iterations:
            return Status.ITERATION_LIMIT, where
        if word.status is Status.TIME_LIMIT:
            return Status.TIME_LIMIT, where
        if word.status is Status.DIVERGED or np.abs(result.w).max() > _DIVERGED:
            return Status.DIVERGED, where or "the cost may be unbounded below"
        said = f"{backend.name}: {word.sentence}" if word.sentence else ""
        return Status.FAILED, "; ".join(part for part in (said, where) if part)

    def where(
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
