"""A quadratic program seen from its multipliers: small, and factorised once for all runs."""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from solvers.linear.qp.quadratic_program import QP
from solvers.linear.regular_matrix import LAPACK, is_regular

# Subtracted from the diagonal so that dependent equations do not stop the factorisation; taken
# out again by refinement.
_REGULARISATION = 1e-12
# How often what rounding left over is corrected; an unstable plant whose inputs are all at a
# bound needs it twice.
_CORRECTIONS = 2
_EXACT = 1e-15


class Optimum(NamedTuple):
    """The best point that meets the equations and some rows: z, and multipliers of all rows."""

    z: np.ndarray
    y: np.ndarray


class MultiplierSpace:
    r"""Optima of a program with any set of rows met, from a small linear system each.

    .. math:: \begin{pmatrix} z \\ y_e \end{pmatrix} =
              K^{-1} \begin{pmatrix} -g \\ e \end{pmatrix} - V y_a, \quad
              K = \begin{pmatrix} H & E' \\ E & 0 \end{pmatrix}, \quad
              V = K^{-1} \begin{pmatrix} G_a' \\ 0 \end{pmatrix}, \quad
              G_a V \, y_a = G_a z_0 - b_a

    E are the rows with equal bounds, G_a those of the other rows that are met, z_0 the optimum
    without them. K is factorised once; a column of V and of M = G V is computed when its row is
    met for the first time, and kept.

    Args:
        qp: whose matrices and equations are meant; other runs may have other vectors.
    """

    def __init__(self, qp: QP) -> None:
        """Factorise K.

        Raises:
            LinAlgError: if it is singular.
        """
        self.equal = qp.l == qp.u
        self._equations = np.flatnonzero(self.equal)
        self._n, count = len(qp.g), len(self._equations)
        self._rows = qp.G.tocsr()
        e = self._rows[self._equations]
        small = -_REGULARISATION * sp.identity(count)
        system = sp.csc_matrix(sp.bmat([[qp.H, e.T], [e, small]], format="csc"))
        if not is_regular(system):
            raise np.linalg.LinAlgError("the matrix of cost and equations is singular")
        self._solve = splu(system).solve
        self._slot = np.full(len(qp.l), -1)
        self._v, self._m = np.empty((self._n + count, 0)), np.empty((0, 0))

    def free(self, qp: QP) -> np.ndarray:
        """Return (z_0; y_e), the optimum where only the equations count."""
        return self._solve(np.concatenate([-qp.g, qp.u[self._equations]]))

    def gram(self, rows: np.ndarray) -> np.ndarray:
        """Return M of some rows, (rows, rows)."""
        slots = self._slots(rows)
        return self._m[slots[:, None], slots]

    def displacement(self, rows: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return V y: by which multipliers of some rows move (z_0; y_e)."""
        return self._v[:, self._slots(rows)] @ y

    def optimum(self, qp: QP, rows: np.ndarray, bound: np.ndarray) -> Optimum | None:
        """Return the optimum with rows met, correct to rounding; None if they are dependent.

        Args:
            qp: the program.
            rows: indices of the rows that are met, none of them an equation.
            bound: what each is equal to.
        """
        factor, failed = LAPACK.dpotrf(self.gram(rows)) if rows.size else (None, 0)
        if failed:
            return None
        n, products, y = self._n, qp.products, np.zeros(len(qp.l))
        z = np.zeros(n)
        right, wanted = np.concatenate([-qp.g, qp.u[self._equations]]), bound
        for _ in range(1 + _CORRECTIONS):
            step = self._solve(right)
            if rows.size:
                own = LAPACK.dpotrs(factor, (products.G @ step[:n])[rows] - wanted)[0]
                step -= self.displacement(rows, own)
                y[rows] += own
            z = z + step[:n]
            y[self._equations] += step[n:]
            reached = products.G @ z
            left = -(products.H @ z + qp.g + products.Gt @ y)
            right = np.concatenate([left, (qp.u - reached)[self._equations]])
            wanted = bound - reached[rows]
            size = 1.0 + max(np.abs(y).max(initial=0.0), np.abs(qp.g).max())
            if max(np.abs(right).max(), np.abs(wanted).max(initial=0.0)) <= _EXACT * size:
                break
        return Optimum(z, y)

    def _slots(self, rows: np.ndarray) -> np.ndarray:
        """Return the places of rows in V and M, after computing what is missing."""
        slots = self._slot[rows]
        if (slots >= 0).all():
            return slots
        new, known = rows[slots < 0], np.flatnonzero(self._slot >= 0)
        order = np.argsort(self._slot[known])
        right = np.zeros((len(self._v), len(new)))
        right[: self._n] = self._rows[new].T.toarray()
        v = self._solve(right)
        cross = self._rows[known[order]] @ v[: self._n]
        own = self._rows[new] @ v[: self._n]
        self._m = np.block([[self._m, cross], [cross.T, (own + own.T) / 2]])
        self._slot[new] = self._v.shape[1] + np.arange(len(new))
        self._v = np.hstack([self._v, v])
        return self._slot[rows]
