"""What a problem made of several problems, its program and its solution promise."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, Generic, Self, TypeVar

from numpy.typing import ArrayLike

from ocp.problem.portable import Portable

#: A verdict of the referee.
V = TypeVar("V", covariant=True)


class CompositeSolution(ABC, Generic[V]):
    """A solution of several problems at once."""

    @abstractmethod
    def with_(self, **changes: Any) -> Self:
        """Return a copy with some fields replaced."""

    @abstractmethod
    def evaluated(self, tolerance: float) -> V:
        """Return the referee's verdict; ``tolerance`` as ``evaluate`` takes it."""


#: A solution.
S = TypeVar("S", bound=CompositeSolution, covariant=True)


class CompositeProgram(ABC, Generic[S]):
    """Several problems prepared by a solver: all symbolic work is done."""

    @abstractmethod
    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: Any = None,
    ) -> S:
        """Solve for these data, see ``Program.run``; a subclass says what they mean."""


class CompositeProblem(Portable, ABC, Generic[S]):
    """Several problems that are solved at once."""

    @abstractmethod
    def first_guess(self, given: Any = None) -> Any:
        """Return where a run starts, checked: what is given, else None.

        Raises:
            ProblemError: if it is nothing that can be sampled.
        """

    @abstractmethod
    def built_by(self, solver: Any) -> CompositeProgram[S]:
        """Let a solver do all symbolic work.

        Raises:
            UnsupportedProblem: naming what this method cannot treat.
        """
