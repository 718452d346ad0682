"""The sparse linear system of a Newton step: put together from blocks, and factorised."""

from collections.abc import Callable
from typing import cast

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from solvers.linear.regular_matrix import LAPACK, is_regular

# Up to this size LAPACK's dense factors cost less than sparse ones.
_DENSE = 200


def block_matrix(rows: list[list[np.ndarray | None]]) -> sparse.csc_matrix:
    """Return the sparse matrix of some blocks; None is a block of zeros.

    Args:
        rows: blocks (m, n) side by side; a column of None alone has no width.
    """
    columns = zip(*rows, strict=True)
    widths = [next((b.shape[1] for b in column if b is not None), 0) for column in columns]
    lefts = np.cumsum([0, *widths])
    entries, top = [], 0
    for row in rows:
        for left, block in zip(lefts, row, strict=False):
            if block is not None:
                i, k = np.nonzero(block)
                entries.append((block[i, k], top + i, left + k))
        top += next(len(block) for block in row if block is not None)
    data, i, k = (np.concatenate(part) for part in zip(*entries, strict=True))
    return sparse.csc_matrix((data, (i, k)), shape=(top, lefts[-1]))


def factorised(jacobian: sparse.csc_matrix) -> Callable[[np.ndarray], np.ndarray]:
    """Return the solve with an LU factorisation; NaN if the Jacobian is singular."""
    size, _ = cast("tuple[int, int]", jacobian.shape)
    if size > _DENSE:
        return splu(jacobian).solve if is_regular(jacobian) else _unsolvable
    if not np.isfinite(jacobian.data).all():
        return _unsolvable
    factor, pivots, singular = LAPACK.dgetrf(jacobian.toarray())
    return _unsolvable if singular else lambda r: LAPACK.dgetrs(factor, pivots, r)[0]


def _unsolvable(r: np.ndarray) -> np.ndarray:
    return np.full_like(r, np.nan)
