"""The nodes of a grid as a user gives them: intervals of unequal lengths."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_numeric, check_positive, check_whole
from ocp.checks.errors import ProblemError

# Two nodes that are nearer than this, in fractions of the horizon, are one.
_SAME = 1e-9


@dataclass(frozen=True)
class Grid:
    """Intervals of any lengths, for methods that take a number of equal ones otherwise.

    ``MultipleShooting(Grid.geometric(20, 1.2))`` has short intervals first, where a controller
    needs them. Its nodes are taken as they are: knots of signals are not added.

    Args:
        fractions: nodes as fractions of the horizon, from 0 to 1, (N + 1,).

    Raises:
        ProblemError: if they are no numbers that increase from 0 to 1.
    """

    fractions: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the nodes, and keep them as a tuple."""
        nodes = _increasing(self.fractions, "fractions")
        if nodes[0] != 0.0 or nodes[-1] != 1.0:
            raise ProblemError(
                f"grid: the fractions run from {nodes[0]:g} to {nodes[-1]:g}, not from 0 to 1; "
                "Grid.of_times takes instants in seconds"
            )
        object.__setattr__(self, "fractions", tuple(nodes.tolist()))

    @classmethod
    def uniform(cls, intervals: int) -> "Grid":
        """Return N equal intervals."""
        check_whole(intervals, "grid: intervals")
        return cls(tuple(np.linspace(0.0, 1.0, intervals + 1)))

    @classmethod
    def geometric(cls, intervals: int, ratio: float) -> "Grid":
        """Return N intervals, each ``ratio`` times as long as the one before it."""
        check_whole(intervals, "grid: intervals")
        check_positive(ratio, "grid: ratio")
        # From the longest on, so that no power overflows.
        widths = min(ratio, 1.0 / ratio) ** np.arange(intervals)
        ends = np.cumsum(widths if ratio < 1.0 else widths[::-1])
        return cls((0.0, *(ends[:-1] / ends[-1]), 1.0))

    @classmethod
    def of_times(cls, times: ArrayLike) -> "Grid":
        """Return the grid with nodes at instants; the first and the last are the horizon's ends.

        Args:
            times: instants [s], or in any other unit, (N + 1,).
        """
        nodes = _increasing(times, "times")
        return cls((0.0, *((nodes[1:-1] - nodes[0]) / (nodes[-1] - nodes[0])), 1.0))

    @property
    def intervals(self) -> int:
        """Number of intervals N."""
        return len(self.fractions) - 1

    def cut(self, parts: int) -> "Grid":
        """Return the grid with every interval cut into equal parts."""
        check_whole(parts, "grid: parts")
        inner = np.linspace(0.0, 1.0, parts, endpoint=False)
        nodes = np.asarray(self.fractions)
        return Grid((*(nodes[:-1, None] + np.diff(nodes)[:, None] * inner).ravel(), 1.0))

    def with_nodes(self, fractions: ArrayLike) -> "Grid":
        """Return the grid with more nodes, at fractions of the horizon; one that is there stays."""
        more = np.ravel(check_numeric(fractions, "grid: fractions"))
        nodes = np.asarray(self.fractions)
        apart = np.abs(more[:, None] - nodes).min(axis=1, initial=1.0) > _SAME
        return Grid(tuple(np.union1d(nodes, more[apart])))


def check_intervals(value: object, what: str, *, least: int = 1) -> None:
    """Check that ``value`` is a number of intervals, or a ``Grid`` of at least so many."""
    check_whole(value.intervals if isinstance(value, Grid) else value, what, least=least)


def number_of(intervals: int | Grid) -> int:
    """Return N."""
    return intervals.intervals if isinstance(intervals, Grid) else intervals


def cut(intervals: int | Grid, parts: int) -> int | Grid:
    """Return as many intervals for each."""
    return intervals.cut(parts) if isinstance(intervals, Grid) else parts * intervals


def _increasing(values: ArrayLike, what: str) -> np.ndarray:
    """Return nodes (N + 1,), or raise ``ProblemError``."""
    nodes = check_numeric(values, f"grid: {what}")
    if nodes.ndim != 1 or len(nodes) < 2:
        raise ProblemError(f"grid: {what} of shape {nodes.shape}; two nodes at least are needed")
    if not np.isfinite(nodes).all():
        raise ProblemError(f"grid: {what} hold a number that is not finite")
    widths = np.diff(nodes)
    if not (widths > _SAME * (nodes[-1] - nodes[0])).all():
        k = int(widths.argmin())
        raise ProblemError(
            f"grid: {what} must increase, by 1e-9 of the horizon at least, but {nodes[k]:g} is "
            f"followed by {nodes[k + 1]:g}"
        )
    return nodes
