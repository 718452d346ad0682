"""A rectangular grid in the state space: interpolation between its points, slopes at them."""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy.sparse import csr_matrix

from ocp import ProblemError
from ocp.internal import check_real, check_whole

# A point outside the grid by less than this part of a cell is on its edge.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Axis:
    """Equally spaced numbers along one state or control.

    Args:
        lower: first one, in the unit of the state or control.
        upper: last one.
        points: how many, at least 3.

    Raises:
        ProblemError: if there is no such axis.
    """

    lower: float
    upper: float
    points: int

    def __post_init__(self) -> None:
        """Check range and number."""
        if not check_real(self.lower, "axis: lower") < check_real(self.upper, "axis: upper"):
            raise ProblemError(f"axis: lower < upper is needed, not {self.lower}, {self.upper}")
        check_whole(self.points, "axis: points", least=3)

    @property
    def values(self) -> np.ndarray:
        """The numbers, (points,)."""
        return np.linspace(self.lower, self.upper, self.points)

    @property
    def step(self) -> float:
        """Distance of two neighbours."""
        return (self.upper - self.lower) / (self.points - 1)

    @property
    def coarser(self) -> "Axis":
        """The axis with half the points; every second one where their number is odd."""
        return Axis(self.lower, self.upper, max(3, (self.points + 1) // 2))


@dataclass(frozen=True)
class StateGrid:
    """The points of several axes; values on it are stored flat, the last axis fastest.

    Attributes:
        axes: one for each dimension.
    """

    axes: tuple[Axis, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis."""
        return tuple(a.points for a in self.axes)

    @property
    def size(self) -> int:
        """Number of points."""
        return int(np.prod(self.shape))

    @cached_property
    def points(self) -> np.ndarray:
        """All points, (size, dimensions)."""
        mesh = np.meshgrid(*[a.values for a in self.axes], indexing="ij")
        return np.stack([m.ravel() for m in mesh], axis=1)

    @property
    def coarser(self) -> "StateGrid":
        """The grid with half the points along each axis."""
        return StateGrid(tuple(a.coarser for a in self.axes))

    def interpolation(self, x: np.ndarray) -> tuple[csr_matrix, np.ndarray]:
        """Return multilinear interpolation at x (n, dimensions) as a matrix, and a mask.

        Weights that are 0 are not stored: a value at a corner then matters only where it has
        a weight, so that ``matrix @ value`` is inf exactly in the cells with an infinite corner.

        Returns:
            the matrix (n, size), with empty rows outside the grid, and a mask (n,).
        """
        inside, cells, parts = self._locate(x)
        n, corners = len(x), 2 ** len(self.axes)
        index = np.empty((n, corners), dtype=np.int32)
        weight = np.empty((n, corners))
        for c, corner in enumerate(product((0, 1), repeat=len(self.axes))):
            at, share = np.zeros(n, dtype=np.int32), inside.astype(float)
            for i, bit in enumerate(corner):
                at = at * np.int32(self.shape[i]) + cells[i] + np.int32(bit)
                share *= parts[i] if bit else 1.0 - parts[i]
            index[:, c], weight[:, c] = at, share
        kept = weight > 0.0
        ends = np.concatenate([[0], np.cumsum(kept.sum(axis=1))]).astype(np.int32)
        matrix = csr_matrix((weight[kept], index[kept], ends), shape=(n, self.size))
        return matrix, inside

    def slopes(self, value: np.ndarray) -> np.ndarray:
        """Return the gradient of flat values (size,) by differences of neighbours.

        Central where both neighbours are finite, one-sided where one is, 0 where none is.

        Returns:
            (size, dimensions).
        """
        field, result = value.reshape(self.shape), []
        for i, axis in enumerate(self.axes):
            v = np.moveaxis(field, i, 0)
            edge = np.full_like(v[:1], np.inf)
            ahead, behind = np.concatenate([v[1:], edge]), np.concatenate([edge, v[:-1]])
            right, rightward = _difference(ahead, v)
            left, leftward = _difference(v, behind)
            count = np.maximum(right.astype(float) + left, 1.0)
            slope = (rightward + leftward) / count / axis.step
            result.append(np.moveaxis(slope, 0, i).ravel())
        return np.stack(result, axis=1)

    def _locate(self, x: np.ndarray) -> tuple[np.ndarray, list[np.ndarray], list[np.ndarray]]:
        """Which points are inside, the cell along each axis, and the position in it from 0 to 1."""
        inside, cells, parts = np.ones(len(x), dtype=bool), [], []
        for i, axis in enumerate(self.axes):
            position = (x[:, i] - axis.lower) / axis.step
            near = np.round(position)
            position = np.where(np.abs(position - near) < _ROUNDING, near, position)
            inside &= (position >= 0.0) & (position <= axis.points - 1)
            position = np.nan_to_num(position, nan=0.0, posinf=0.0, neginf=0.0)
            cell = np.clip(np.floor(position), 0, axis.points - 2)
            cells.append(cell.astype(np.int32))
            parts.append(np.clip(position - cell, 0.0, 1.0))
        return inside, cells, parts


def _difference(after: np.ndarray, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where both are finite, and there after - before, 0 elsewhere."""
    both = np.isfinite(after) & np.isfinite(before)
    return both, np.subtract(after, before, out=np.zeros_like(after), where=both)
