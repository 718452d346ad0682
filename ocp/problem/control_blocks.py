"""Controls that are held over several intervals of a grid: blocks of moves, a control horizon."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ocp.checks.arguments import check_instance, check_whole
from ocp.checks.errors import ProblemError


@dataclass(frozen=True, eq=False)
class ControlBlocks:
    """Which intervals of a grid share a control.

    Attributes:
        leaders: the interval with which the block of each begins, (N,).
        held: which controls are held, (m,); slacks beside them are not.
    """

    leaders: np.ndarray
    held: np.ndarray

    @classmethod
    def of(
        cls, lengths: Sequence[int], intervals: int, held: Sequence[int], what: str
    ) -> "ControlBlocks | None":
        """Lay blocks on a grid; None where there are none.

        Args:
            lengths: number of intervals in each block; the last one goes on to the end.
            intervals: N.
            held: which controls are held.
            what: how a message begins.

        Raises:
            ProblemError: if the blocks are longer than the grid.
        """
        if not lengths or not held:
            return None
        total = sum(lengths)
        if total > intervals:
            raise ProblemError(
                f"{what}: blocks = {tuple(lengths)} are {total} intervals long, the grid has "
                f"{intervals}"
            )
        own = np.array(lengths)
        own[-1] += intervals - total
        return cls(np.repeat(np.cumsum(own) - own, own), np.array(held))

    @property
    def follows(self) -> np.ndarray:
        """Which intervals go on with the control of the one before, bool (N,)."""
        return self.leaders < np.arange(len(self.leaders))

    def holding(self, u: np.ndarray) -> np.ndarray:
        """Return controls (N, nu) with those of the first interval in every block."""
        u = u.copy()
        u[:, self.held] = u[self.leaders[:, None], self.held]
        return u

    def mean(self, slopes: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return slopes (N, nu) with the mean of every block, by the weights (N,)."""
        count, slopes = len(weights), slopes.copy()
        own = slopes[:, self.held] * weights[:, None]
        total = np.zeros_like(own)
        np.add.at(total, self.leaders, own)
        length = np.bincount(self.leaders, weights, count)
        slopes[:, self.held] = total[self.leaders] / length[self.leaders, None]
        return slopes


def check_blocks(blocks: Sequence[int], what: str) -> tuple[int, ...]:
    """Return the lengths of blocks as a tuple, or raise ``ProblemError``."""
    check_instance(blocks, (tuple, list), f"{what}: blocks")
    return tuple(check_whole(length, f"{what}: the length of a block") for length in blocks)
