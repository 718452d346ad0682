"""Whether a sparse matrix is regular, found by LAPACK, which a singular one does not crash."""

from typing import Any, cast

import numpy as np
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse.csgraph import reverse_cuthill_mckee

# Its functions are compiled and have no types.
LAPACK: Any = lapack
# Reciprocal condition number of the balanced matrix: below, the matrix is singular to rounding.
_SINGULAR = 1e-17
# Rounds in which rows and columns are divided by the square roots of their largest entries.
_ROUNDS = 3


def is_regular(matrix: sparse.csc_matrix) -> bool:
    """Whether a square matrix (n, n) is finite and not singular to rounding.

    SuperLU (``scipy.sparse.linalg.splu``) reads memory that is not its own where a column has no
    pivot left, so what may be singular is tested before. Here the matrix is balanced, ordered to
    a narrow band [Cuthill & McKee 1969] and factorised with partial pivoting; its condition
    number is estimated from the factors [Higham 1988].
    """
    if not np.isfinite(matrix.data).all():
        return False
    banded = _narrow(_balanced(sparse.coo_matrix(matrix)))
    n, _ = _shape(banded)
    offsets = banded.row - banded.col
    below, above = int(offsets.max(initial=0)), int(-offsets.min(initial=0))
    if 2 * below + above + 1 >= n:
        return _dense(banded.toarray())
    band = np.zeros((2 * below + above + 1, n), order="F")
    band[below + above + offsets, banded.col] = banded.data
    norm = float(np.bincount(banded.col, np.abs(banded.data), n).max(initial=0.0))
    factor, pivots, info = LAPACK.dgbtrf(band, below, above, overwrite_ab=True)
    if info:
        return False
    reciprocal, _ = LAPACK.dgbcon(below, above, factor, pivots, norm)
    return bool(reciprocal > _SINGULAR)


def _dense(matrix: np.ndarray) -> bool:
    norm = float(np.abs(matrix).sum(axis=0).max(initial=0.0))
    factor, _, info = LAPACK.dgetrf(matrix)
    return not info and bool(LAPACK.dgecon(factor, norm)[0] > _SINGULAR)


def _balanced(matrix: sparse.coo_matrix) -> sparse.coo_matrix:
    """Return the matrix with the largest entries of rows and columns near 1 [Ruiz 2001]."""
    rows, columns, data = matrix.row, matrix.col, matrix.data.astype(float)
    for _ in range(_ROUNDS):
        for index, size in zip((rows, columns), _shape(matrix), strict=True):
            largest = np.zeros(size)
            np.maximum.at(largest, index, np.abs(data))
            data = data / np.sqrt(np.where(largest > 0.0, largest, 1.0))[index]
    return sparse.coo_matrix((data, (rows, columns)), shape=matrix.shape)


def _narrow(matrix: sparse.coo_matrix) -> sparse.coo_matrix:
    """Return the matrix with rows and columns in an order that has a narrow band."""
    order = reverse_cuthill_mckee(sparse.csr_matrix(abs(matrix) + abs(matrix.T)), True)
    place = np.empty(len(order), dtype=int)
    place[order] = np.arange(len(order))
    return sparse.coo_matrix(
        (matrix.data, (place[matrix.row], place[matrix.col])), shape=matrix.shape
    )


def _shape(matrix: sparse.coo_matrix) -> tuple[int, int]:
    return cast("tuple[int, int]", matrix.shape)
