"""A quadratic program, its residuals, and the exact penalty that makes rows soft."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

# Up to this many entries a product with a dense matrix is quicker than with a sparse one.
_DENSE = 20_000


class Products(NamedTuple):
    """H, G and G' in whatever layout multiplies a vector quickest."""

    H: Any
    G: Any
    Gt: Any

    @classmethod
    def of(cls, h: sp.csc_matrix, g: sp.csc_matrix) -> "Products":
        """Lay the matrices out."""
        rows, n = _shape(g)
        if rows * n <= _DENSE:
            dense = g.toarray()
            return cls(h.toarray(), dense, np.ascontiguousarray(dense.T))
        return cls(h.tocsr(), g.tocsr(), g.T.tocsr())


class QpVectors(NamedTuple):
    """What changes from run to run: g, and the bounds l and u of the rows."""

    g: np.ndarray
    l: np.ndarray  # noqa: E741
    u: np.ndarray


class QP(NamedTuple):
    r"""A convex quadratic program.

    .. math:: \min_z \; \frac12 z'Hz + g'z \quad \text{s.t.} \quad l \le Gz \le u

    Attributes:
        H: symmetric, sparse by columns (n, n).
        G: sparse by columns (rows, n).
        products: the same, to multiply with.
        g: (n,).
        l: (rows,), equal to ``u`` for an equation.
        u: (rows,).
    """

    H: sp.csc_matrix
    G: sp.csc_matrix
    products: Products
    g: np.ndarray
    l: np.ndarray  # noqa: E741
    u: np.ndarray

    @classmethod
    def of(cls, h: sp.csc_matrix, g: sp.csc_matrix) -> "QP":
        """Return a program whose vectors are still to come, by ``with_vectors``."""
        nothing = np.empty(0)
        return cls(h, g, Products.of(h, g), nothing, nothing, nothing)

    def with_vectors(self, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> "QP":
        """Return the program with the same matrices and these vectors."""
        return QP(self.H, self.G, self.products, g, low, high)


class Residuals(NamedTuple):
    """How far a point is from optimal, relative to the size of what has to cancel.

    Attributes:
        primal: largest violation of a row.
        dual: largest component of Hz + g + G'y.
        gap: difference of the primal and the dual cost.
    """

    primal: float
    dual: float
    gap: float


NO_POINT = Residuals(np.inf, np.inf, np.inf)


def residuals(qp: QP, z: np.ndarray, y: np.ndarray) -> Residuals:
    """Return the residuals of a point, whatever a backend says about it.

    Args:
        qp: the program.
        z: (n,).
        y: multipliers (rows,), positive at upper bounds, negative at lower ones. The sign a
            bound that does not exist would have counts as a dual residual.
    """
    gz, hz, gty = qp.products.G @ z, qp.products.H @ z, qp.products.Gt @ y
    primal = max((qp.l - gz).max(initial=0.0), (gz - qp.u).max(initial=0.0))
    impossible = np.where(y > 0.0, np.isinf(qp.u), np.isinf(qp.l)) * np.abs(y)
    dual = max(np.abs(hz + qp.g + gty).max(initial=0.0), impossible.max(initial=0.0))
    bound = np.where(y > 0.0, qp.u, qp.l)
    paid = y @ np.where(np.isfinite(bound), bound, 0.0)
    quadratic, linear = float(z @ hz), float(qp.g @ z)
    sizes = [np.abs(v).max(initial=0.0) for v in (gz, hz, qp.g, gty)]
    return Residuals(
        primal / (1.0 + sizes[0]),
        dual / (1.0 + max(sizes[1:])),
        abs(float(quadratic + linear + paid))
        / float(1.0 + max(abs(quadratic), abs(linear), abs(paid))),
    )


@dataclass(frozen=True, eq=False)
class Softening:
    r"""Rows that may be exceeded, with a penalty.

    .. math:: l_i - e_i \le G_i z \le u_i + e_i, \quad e_i \ge 0, \quad
              \dots + p_i e_i + \tfrac12 c_i e_i^2

    Exact: where the hard program is feasible and p exceeds its multipliers, both have the
    same solution [Nocedal & Wright 2006, section 17.2].

    Attributes:
        rows: which rows, indices (s,).
        price: p, positive (s,).
        curvature: c, positive (s,).
    """

    rows: np.ndarray
    price: np.ndarray
    curvature: np.ndarray

    def soften(self, h: sp.csc_matrix, g: sp.csc_matrix) -> tuple[sp.csc_matrix, sp.csc_matrix]:
        """Return the matrices H and G of the program with slacks e behind z."""
        count = len(self.rows)
        unit = sp.identity(count, format="csc")
        select = sp.csc_matrix(
            (-np.ones(count), (self.rows, np.arange(count))), shape=(_shape(g)[0], count)
        )
        zero = sp.csc_matrix((count, _shape(g)[1]))
        rows = sp.bmat([[g, select], [g[self.rows], unit], [zero, unit]], format="csc")
        return (
            sp.csc_matrix(sp.block_diag([h, sp.diags(self.curvature)], format="csc")),
            sp.csc_matrix(rows),
        )

    def soften_vectors(self, vectors: QpVectors) -> QpVectors:
        """Return g, l and u of the program with slacks."""
        g, low, high = vectors
        count = len(self.rows)
        hard = low.copy()
        hard[self.rows] = -np.inf
        free = np.full(count, np.inf)
        return QpVectors(
            np.concatenate([g, self.price]),
            np.concatenate([hard, low[self.rows], np.zeros(count)]),
            np.concatenate([high, free, free]),
        )

    def multipliers(self, y: np.ndarray) -> np.ndarray:
        """Return one multiplier per original row."""
        count = len(self.rows)
        total = y[: len(y) - 2 * count].copy()
        total[self.rows] += y[len(total) : len(total) + count]
        return total


def _shape(matrix: sp.csc_matrix) -> tuple[int, int]:
    """Rows and columns of a matrix; scipy's types do not promise a shape."""
    return matrix.shape or (0, 0)
