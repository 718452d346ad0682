"""A benchmark case: a problem, its reference value, and which methods it is a fixture for."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from ocp import OCP

Family = Literal["direct", "gradient", "indirect", "polish", "clearance", "instantaneous"]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem with a reference.

    Attributes:
        name: unique in its suite.
        suite: the suite it belongs to.
        build: returns the problem; called in the process that solves it.
        reference: optimal cost; None where none is certified.
        source: where the reference comes from.
        accuracy: relative error of the reference.
        families: methods that the case declares.
        costate0: dJ*/dx at t0 where known.
        local_costs: other local minima that have been seen.
    """

    name: str
    suite: str
    build: Callable[[], OCP]
    reference: float | None
    source: str
    accuracy: float = 1e-8
    families: frozenset[Family] = frozenset()
    costate0: tuple[float, ...] | None = None
    local_costs: tuple[float, ...] = ()

    def gap(self, cost: float) -> float | None:
        """Return (cost - reference) / reference; None without a reference."""
        if self.reference is None:
            return None
        return (cost - self.reference) / max(abs(self.reference), 1e-12)
