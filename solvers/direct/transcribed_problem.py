"""The interface of a problem on a grid: what backends and ``NlpRun`` use of it."""

from functools import cached_property
from typing import Protocol

import casadi as ca
import numpy as np

from ocp import OCP
from ocp.internal import ConstraintRow, RunData


class TranscribedProblem(Protocol):
    """A problem on a grid: ``Transcription`` by shooting, ``CollocatedProblem`` by collocation."""

    @property
    def ocp(self) -> OCP:
        """The problem."""
        ...

    @property
    def fractions(self) -> np.ndarray:
        """The nodes, as fractions of the horizon; ``ConstraintRow.node`` counts them."""
        ...

    @cached_property
    def program(self) -> dict[str, ca.MX]:
        """Unknowns x, cost f, constraints g and data p."""
        ...

    @cached_property
    def rows(self) -> tuple[ConstraintRow, ...]:
        """The meaning of each row of g."""
        ...

    @property
    def is_control(self) -> np.ndarray:
        """Which unknowns are controls, bool (size,)."""
        ...

    @property
    def is_later_state(self) -> np.ndarray:
        """Which unknowns are states after the start, bool (size,)."""
        ...

    def bounds(self, data: RunData) -> dict[str, np.ndarray]:
        """Return lbx, ubx, lbg, ubg for a start."""
        ...

    def data_vector(self, data: RunData) -> np.ndarray:
        """Return the value of p."""
        ...

    def duration(self, w: np.ndarray) -> float:
        """Return final time minus t0 [s] of a vector of unknowns."""
        ...

    def worst(
        self, w: np.ndarray, g: np.ndarray, bounds: dict[str, np.ndarray]
    ) -> tuple[float, ConstraintRow | None]:
        """Return the largest violation and what is violated."""
        ...
