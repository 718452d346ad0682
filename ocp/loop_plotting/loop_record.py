"""What the pictures of a closed loop read."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ocp.problem.ocp import OCP
from ocp.solution.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# (axes, x (nx,), t [s]) -> the scene.
Draw = Callable[["Axes", np.ndarray, float], object]


class Source(Protocol):
    """Where an input comes from: ``OPTIMAL``, ``FEASIBLE``, ``SHIFTED`` or ``BACKUP``."""

    @property
    def name(self) -> str:
        """Which of them."""
        ...


class PlannedInput(Protocol):
    """One decision; see ``Decision``."""

    @property
    def applies_at(self) -> float:
        """From when on the input is meant to act [s]."""
        ...

    @property
    def input(self) -> np.ndarray:
        """What the plant receives (m,)."""
        ...

    @property
    def parameters(self) -> Mapping[str, np.ndarray]:
        """Values of parameters, and samples of signals ahead, by name."""
        ...

    @property
    def clipped(self) -> float:
        """By how much it was moved into its bounds."""
        ...

    @property
    def plan(self) -> Solution | None:
        """That it comes from."""
        ...


class LoopRecord(Protocol):
    """A closed loop of K steps; see ``Rollout``."""

    @property
    def plant(self) -> OCP:
        """Names, units and dimensions."""
        ...

    @property
    def t(self) -> np.ndarray:
        """Sampling instants (K + 1,) [s]."""
        ...

    @property
    def x(self) -> np.ndarray:
        """States (K + 1, nx)."""
        ...

    @property
    def measured(self) -> np.ndarray:
        """What the controller was told (K, nx)."""
        ...

    @property
    def inputs(self) -> np.ndarray:
        """What acted in each interval (K, m)."""
        ...

    @property
    def costs(self) -> np.ndarray:
        """Running cost over each interval (K,)."""
        ...

    @property
    def cost(self) -> float:
        """Their sum."""
        ...

    @property
    def worst(self) -> str:
        """What was violated most, in words."""
        ...

    @property
    def ended(self) -> str:
        """Why the loop ended early."""
        ...

    @property
    def counts(self) -> Mapping[Any, int]:
        """How many inputs came from each source."""
        ...

    @property
    def decided_by(self) -> str:
        """How many inputs came from which source, in words."""
        ...

    @property
    def decisions(self) -> Sequence[PlannedInput]:
        """With their plans; empty where they are not known."""
        ...

    def acting(self, k: int) -> Source | None:
        """Return the source of the input in interval k; None where it was decided before t0."""
        ...
