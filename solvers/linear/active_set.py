"""From an approximate solution of a quadratic program to an exact one."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.sparse.linalg import splu

from solvers.linear.quadratic_program import QP, residuals

# Its functions are compiled and have no types.
_LAPACK: Any = lapack
# Put on the diagonal so that dependent rows do not stop the factorisation; taken out again by
# iterative refinement.
_REGULARISATION = 1e-12
_REFINEMENTS = 2
_LIMIT = 12
# Up to this many unknowns a dense factorisation is quicker than a sparse one.
_DENSE = 160


Solve = Callable[[np.ndarray], np.ndarray]


class Refined(NamedTuple):
    """A point, its multipliers, its largest residual, and how many factorisations it took."""

    z: np.ndarray
    y: np.ndarray
    residual: float
    factorisations: int


class ActiveSet:
    r"""Newton's method on the optimality conditions: guess the active rows, solve, correct.

    .. math:: \begin{pmatrix} H & G_a' \\ G_a & 0 \end{pmatrix}
              \begin{pmatrix} z \\ y_a \end{pmatrix} = \begin{pmatrix} -g \\ b_a \end{pmatrix}

    A row stays active while its multiplier has the right sign, and becomes active when it is
    violated [Hintermueller, Ito & Kunisch 2002]. From a good guess it ends after a few steps,
    exact to rounding; from a bad one it may cycle, which the residual tells.

    Args:
        h: H of all programs it is used for.
        g: G of all of them.
    """

    def __init__(self, h: sp.csc_matrix, g: sp.csc_matrix) -> None:
        """Take the matrices apart."""
        self._h, self._g = h.tocoo(), g.tocoo()
        self._n = len(h.indptr) - 1
        self._full: tuple[np.ndarray, np.ndarray] | None = None
        scale = max(1.0, np.abs(h.data).max(initial=0.0))
        self._shift = _REGULARISATION * scale

    def refine(self, qp: QP, z: np.ndarray, y: np.ndarray, tolerance: float) -> Refined:
        """Return the best point found, starting from the active rows that (z, y) suggests."""
        rows = qp.G @ z
        equal = qp.l == qp.u
        up, low = (qp.u - rows < y) & ~equal, (rows - qp.l < -y) & ~equal
        best = Refined(z, y, np.inf, 0)
        seen: set[bytes] = set()
        for count in range(1, _LIMIT + 1):
            key = np.packbits(np.concatenate([up, low])).tobytes()
            if key in seen:
                break
            seen.add(key)
            z, y = self._solve(qp, equal | up | low, np.where(low, qp.l, qp.u))
            if not (np.isfinite(z).all() and np.isfinite(y).all()):
                break
            found = max(residuals(qp, z, y))
            if found < best.residual:
                best = Refined(z, y, found, count)
            if found <= tolerance:
                break
            rows = qp.G @ z
            up = ~equal & np.where(up, y > 0.0, rows > qp.u)
            low = ~equal & ~up & np.where(low, y < 0.0, rows < qp.l)
        return best._replace(factorisations=len(seen))

    def _solve(
        self, qp: QP, active: np.ndarray, bound: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return z and y where the active rows are equations."""
        n, picked = self._n, np.flatnonzero(active)
        size = n + len(picked)
        diagonal = np.full(size, -_REGULARISATION)
        diagonal[:n] = self._shift
        try:
            kkt, solve = (self._dense if size <= _DENSE else self._sparse)(picked, diagonal)
        except RuntimeError:  # exactly singular
            return np.full(n, np.nan), np.full(len(active), np.nan)
        right = np.concatenate([-qp.g, bound[picked]])
        solution = solve(right)
        with np.errstate(all="ignore"):  # of a singular dense one the numbers are not finite
            for _ in range(_REFINEMENTS):
                solution += solve(right - kkt @ solution + diagonal * solution)
        y = np.zeros(len(active))
        y[picked] = solution[n:]
        return solution[:n], y

    def _dense(self, picked: np.ndarray, diagonal: np.ndarray) -> tuple[np.ndarray, Solve]:
        n = self._n
        if self._full is None:
            self._full = self._h.toarray(), self._g.toarray()
        kkt = np.diag(diagonal)
        kkt[:n, :n] += self._full[0]
        kkt[n:, :n] = self._full[1][picked]
        kkt[:n, n:] = kkt[n:, :n].T
        lu, pivots, _ = _LAPACK.dgetrf(kkt)
        return kkt, lambda right: _LAPACK.dgetrs(lu, pivots, right)[0]

    def _sparse(self, picked: np.ndarray, diagonal: np.ndarray) -> tuple[sp.csc_matrix, Solve]:
        n, size = self._n, len(diagonal)
        count = (self._g.shape or (0, 0))[0]
        position = np.full(count, -1)
        position[picked] = n + np.arange(len(picked))
        keep = position[self._g.row] >= 0
        at, col, value = position[self._g.row[keep]], self._g.col[keep], self._g.data[keep]
        own = np.arange(size)
        entries = (
            np.concatenate([self._h.data, value, value, diagonal]),
            (
                np.concatenate([self._h.row, at, col, own]),
                np.concatenate([self._h.col, col, at, own]),
            ),
        )
        kkt = sp.csc_matrix(entries, shape=(size, size))
        return kkt, splu(kkt).solve
