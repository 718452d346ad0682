"""``FeedbackMethodProgram``: a method whose program prepares answers and corrects them at once."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ocp.method.method_program import MethodProgram, RunResult
from ocp.problem.run_data import RunData
from ocp.solution.solution import SAME_INSTANT, Solution
from ocp.solution.solver import FeedbackProgram, InitialGuess


@dataclass(frozen=True, eq=False)
class FeedbackMethodProgram(MethodProgram, FeedbackProgram):
    """A method that keeps what it has prepared until its memory is used for something else."""

    # For which run a feedback is prepared: none or one.
    _prepared: list[RunData] = field(default_factory=list, init=False, repr=False)

    def prepare_feedback(
        self,
        *,
        x0: ArrayLike,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> bool:
        """Solve for the expected data, see ``FeedbackProgram``."""
        data, first = RunData.of(self.ocp, x0, t0, parameters), self._first_guess(guess)
        with self._lock:
            self.forget_feedback()
            if not self._freeze(data, first):
                return False
            self._prepared.append(data)
        return True

    def feedback(
        self,
        *,
        x0: ArrayLike,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
    ) -> Solution | None:
        """Correct the answer that was prepared, see ``FeedbackProgram``."""
        data = RunData.of(self.ocp, x0, t0, parameters)
        with self._lock:
            started = perf_counter()
            if not (self._prepared and _is_same_run(self._prepared.pop(), data, self.ocp.duration)):
                return None
            result = self._fed_back(data)
            seconds = perf_counter() - started
        return None if result is None else self._solution(data, result, seconds)

    def forget_feedback(self) -> None:
        """Say that its memory is about to be used for something else."""
        self._prepared.clear()

    @abstractmethod
    def _freeze(self, data: RunData, guess: InitialGuess | None) -> bool:
        """Solve for checked data, and keep what ``_fed_back`` needs; return whether that worked."""

    @abstractmethod
    def _fed_back(self, data: RunData) -> RunResult | None:
        """Correct the answer for another start; None where the correction has no solution."""


def _is_same_run(one: RunData, other: RunData, duration: float) -> bool:
    """Whether two runs differ in the start alone, but for rounding."""
    if abs(one.t0 - other.t0) > SAME_INSTANT * duration:
        return False
    pairs = zip(one.values.values, other.values.values, strict=True)
    return one.values is other.values or all(np.array_equal(*pair) for pair in pairs)
