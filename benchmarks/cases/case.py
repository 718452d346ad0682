"""A benchmark case: a problem or phases, its reference, and which methods it is a fixture for."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Literal

from ocp import OCP, Phases, ProblemError

Family = Literal[
    "direct",
    "collocation",
    "between",
    "gradient",
    "indirect",
    "polish",
    "clearance",
    "instantaneous",
]
Difficulty = Literal[
    "easy",
    "smooth",
    "long",
    "nonconvex",
    "bang-bang",
    "singular",
    "state-constrained",
    "mixed-constrained",
]


@dataclass(frozen=True)
class Reference:
    """An interval that contains the optimal cost.

    Attributes:
        value: its middle.
        error: half its width, absolute; 0 only where the value is a rational number.
        how: how it was obtained: ``"closed form: derivation"``, or by which methods.

    Raises:
        ProblemError: if the value is not finite or the error negative.
    """

    value: float
    error: float
    how: str

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not isfinite(self.value) or not (isfinite(self.error) and self.error >= 0.0):
            raise ProblemError(f"reference {self.value} ± {self.error} is no interval")
        if not self.how:
            raise ProblemError(f"reference {self.value}: say how it was obtained")

    @property
    def lower(self) -> float:
        """No feasible answer costs less."""
        return self.value - self.error

    @property
    def upper(self) -> float:
        """A feasible answer that costs no more exists."""
        return self.value + self.error

    @property
    def is_closed_form(self) -> bool:
        """Whether the value was derived, not computed by a solver."""
        return self.how.startswith("closed form")


@dataclass(frozen=True)
class Published:
    """A value that somebody has printed for the same problem.

    Attributes:
        value: as printed, with the sign of the case.
        source: [Author Year], or where it is repeated.
    """

    value: float
    source: str


@dataclass(frozen=True, kw_only=True)
class KnownOptimum:
    """What is known of a problem, whatever it is built of.

    Attributes:
        name: unique in the library.
        suite: the suite it belongs to.
        source: where the problem comes from.
        reference: an interval around the optimal cost; None where none is certified.
        difficulty: what makes it hard, in a word.
        families: methods that the case declares.
        published: values found in print.
        local_costs: other local minima that have been seen.
    """

    name: str
    suite: str
    source: str
    reference: Reference | None
    difficulty: Difficulty
    families: frozenset[Family] = frozenset()
    published: tuple[Published, ...] = ()
    local_costs: tuple[float, ...] = ()

    def gap(self, cost: float) -> float | None:
        """Return (cost - reference) / abs(reference); None without a reference."""
        if self.reference is None:
            return None
        return (cost - self.reference.value) / max(abs(self.reference.value), 1e-12)

    def errors(self) -> tuple[float, ...]:
        """Return the relative error of each published value; without a reference none."""
        gaps = [self.gap(published.value) for published in self.published]
        return tuple(gap for gap in gaps if gap is not None)


@dataclass(frozen=True, kw_only=True)
class Case(KnownOptimum):
    """A problem with a reference.

    Attributes:
        build: returns the problem; called in the process that solves it.
        costate0: dJ*/dx at t0 where known.
    """

    build: Callable[[], OCP]
    costate0: tuple[float, ...] | None = None


@dataclass(frozen=True, kw_only=True)
class PhasesCase(KnownOptimum):
    """Phases with a reference. They are no case of a sweep, whose methods take one problem.

    Attributes:
        build: returns the phases.
    """

    build: Callable[[], Phases]
