"""A problem written in other terms, and the way there and back."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ocp.method.judged import judged
from ocp.problem.model import Model
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData
from ocp.solution.solution import Solution
from ocp.solution.solver import FeedbackProgram, InitialGuess, Program, why_no_feedback


class Rewriting(ABC):
    """Two problems of which one is the other in other terms, for a method that needs it so."""

    @property
    @abstractmethod
    def original(self) -> OCP:
        """The problem as it was written."""

    @property
    @abstractmethod
    def problem(self) -> OCP:
        """The one that a method gets."""

    def start(self, data: RunData) -> np.ndarray:
        """Return the start (nx,) in terms of the method, for a run of the original."""
        return data.x0

    def parameters(self, given: Mapping[str, ArrayLike] | None) -> Mapping[str, ArrayLike] | None:
        """Return parameters in terms of the method, of those of a run of the original."""
        return given

    def guess(self, given: InitialGuess, data: RunData) -> InitialGuess:
        """Return a guess in terms of the method, for one of a run of the original."""
        return given

    @abstractmethod
    def answer(self, found: Solution) -> Solution:
        """Return a solution of the original for one of the method's."""


@dataclass(frozen=True, eq=False)
class RewrittenProgram(FeedbackProgram):
    """A program in terms of a method, asked and answering in those of the user.

    Attributes:
        rewriting: the way there and back.
        program: solves the method's problem.
        accuracy: of a success, see ``judged``; inf: nothing is compared, or by ``program`` itself.
        slack: of terminal constraints, see ``judged``.
    """

    rewriting: Rewriting
    program: Program
    accuracy: float = np.inf
    slack: float = 0.0

    @property
    def is_stateful(self) -> bool:
        """Whether an answer depends on the runs before it."""
        return self.program.is_stateful

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Solve for these data, see ``Program.run``."""
        started, original = perf_counter(), self.rewriting.original
        data, given = RunData.of(original, x0, t0, parameters), original.first_guess(guess)
        found = self.program.run(
            x0=self.rewriting.start(data),
            t0=t0,
            parameters=self.rewriting.parameters(parameters),
            guess=None if given is None else self.rewriting.guess(given, data),
        )
        answer = self._answer(found, data, started)
        return judged(answer, self.accuracy, slack=self.slack)

    @property
    def no_feedback(self) -> str:
        """Why the inner program does not."""
        return why_no_feedback(self.program)

    def prepare_feedback(
        self,
        *,
        x0: ArrayLike,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> bool:
        """Solve for the expected data, see ``FeedbackProgram``."""
        if not isinstance(self.program, FeedbackProgram):
            return False
        original = self.rewriting.original
        data, given = RunData.of(original, x0, t0, parameters), original.first_guess(guess)
        return self.program.prepare_feedback(
            x0=self.rewriting.start(data),
            t0=t0,
            parameters=self.rewriting.parameters(parameters),
            guess=None if given is None else self.rewriting.guess(given, data),
        )

    def feedback(
        self,
        *,
        x0: ArrayLike,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
    ) -> Solution | None:
        """Correct the answer that was prepared, see ``FeedbackProgram``."""
        if not isinstance(self.program, FeedbackProgram):
            return None
        started, data = perf_counter(), RunData.of(self.rewriting.original, x0, t0, parameters)
        found = self.program.feedback(
            x0=self.rewriting.start(data),
            t0=t0,
            parameters=self.rewriting.parameters(parameters),
        )
        return None if found is None else self._answer(found, data, started)

    def _answer(self, found: Solution, data: RunData, started: float) -> Solution:
        answer = self.rewriting.answer(found)
        return answer.with_(x0=data.x0, solve_time=perf_counter() - started)


# What a guess says of a part of a trajectory, (k, width), or None.
Sampled = np.ndarray | None


@dataclass(frozen=True, eq=False)
class RewrittenGuess:
    """A guess of the original, sampled in terms of a method.

    Attributes:
        guess: of the original.
        sampled: (part, fractions, what the guess says of it) -> in terms of the method.
        model: of the original.
        instead: one row of a part that the guess says nothing of, where it has to be known.
    """

    guess: InitialGuess
    sampled: Callable[[str, np.ndarray, np.ndarray], Sampled]
    model: Model
    instead: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def duration(self) -> float | None:
        """Final time minus t0 [s], where it is free."""
        return self.guess.duration

    def sample(self, part: str, fractions: np.ndarray, width: int) -> Sampled:
        """Return a part at fractions of the horizon, or None."""
        own = self.model.nu if part == "u" else self.model.nx
        values = self.guess.sample(part, fractions, own)
        if values is None and part in self.instead:
            values = np.tile(self.instead[part], (len(fractions), 1))
        return None if values is None else self.sampled(part, fractions, values)
