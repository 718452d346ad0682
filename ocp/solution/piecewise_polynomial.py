"""A control that is a polynomial on each piece of the horizon, by its Bernstein coefficients."""

from dataclasses import dataclass

import numpy as np

# Instants that differ from an edge by less, relative to the horizon, lie on it.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class PiecewisePolynomial:
    r"""Polynomials in the Bernstein basis, one a piece.

    .. math:: u(t) = \sum_{i=0}^{m-1} \binom{m-1}{i} s^i (1 - s)^{m-1-i} \, c_i, \quad
              s = (t - t_k) / (t_{k+1} - t_k)

    The basis is positive and sums to one: where all coefficients are within bounds, so is the
    polynomial, everywhere. The first and the last coefficient are its values at the ends.

    Attributes:
        edges: where the pieces meet [s], (K + 1,).
        coefficients: c, (K, m, nu).
    """

    edges: np.ndarray
    coefficients: np.ndarray

    def of(self, t: np.ndarray) -> np.ndarray:
        """Return the piece that goes on from each instant (P,); an edge begins the next one."""
        slack = _ROUNDING * (self.edges[-1] - self.edges[0])
        piece = np.searchsorted(self.edges, t + slack, side="right") - 1
        return np.clip(piece, 0, len(self.coefficients) - 1)

    def at(self, t: np.ndarray, piece: np.ndarray | None = None) -> np.ndarray:
        """Return the values at instants (P,) -> (P, nu), held beyond both ends.

        Args:
            t: instants [s].
            piece: which piece is meant at each, where an edge belongs to two.
        """
        piece = self.of(t) if piece is None else piece
        return bernstein(self.coefficients[piece], self.share(t, piece))

    def share(self, t: np.ndarray, piece: np.ndarray) -> np.ndarray:
        """Return how far into its piece each instant is, 0 to 1, (P,)."""
        begin, end = self.edges[piece], self.edges[piece + 1]
        return np.clip((t - begin) / (end - begin), 0.0, 1.0)

    def basis(self, t: np.ndarray, piece: np.ndarray) -> np.ndarray:
        """Return the basis of each instant's piece there, (P, m): d value / d coefficients."""
        count = self.coefficients.shape[1]
        unit = np.broadcast_to(np.eye(count), (len(t), count, count))
        return bernstein(unit, self.share(t, piece))


def bernstein(coefficients: np.ndarray, s: np.ndarray) -> np.ndarray:
    r"""Return the values of polynomials, (P, n).

    .. math:: \sum_{i=0}^{m-1} \binom{m-1}{i} s^i (1 - s)^{m-1-i} \, c_i

    By de Casteljau's convex combinations: a polynomial with equal coefficients is met without
    rounding.

    Args:
        coefficients: c of each polynomial, (P, m, n).
        s: where each is evaluated, 0 to 1, (P,).
    """
    rows, share = coefficients, np.asarray(s)[:, None, None]
    while rows.shape[1] > 1:
        rows = rows[:, :-1] + share * (rows[:, 1:] - rows[:, :-1])
    return rows[:, 0]


def antiderivative(coefficients: np.ndarray, widths: np.ndarray, values: np.ndarray) -> np.ndarray:
    r"""Return the coefficients (K, m + 1) of what has given polynomials as its derivative.

    .. math:: U_0 = u(t_k), \quad U_{i+1} = U_i + \tfrac{h_k}{m} c_i, \quad U_m = u(t_{k+1})

    Args:
        coefficients: c of the derivative, (K, m).
        widths: h of the pieces [s], (K,).
        values: where the pieces meet, (K + 1,): it is continuous, whatever rounding did to the sum.
    """
    m = coefficients.shape[1]
    inside = values[:-1, None] + np.cumsum(widths[:, None] / m * coefficients[:, :-1], axis=1)
    return np.hstack([values[:-1, None], inside, values[1:, None]])


def elevated(coefficients: np.ndarray, count: int) -> np.ndarray:
    r"""Return the same polynomial with more Bernstein coefficients.

    .. math:: c^+_i = \tfrac{i}{m} c_{i-1} + (1 - \tfrac{i}{m}) c_i, \quad i = 0 \dots m

    raises the degree m - 1 by one, again and again.

    Args:
        coefficients: (m, n).
        count: coefficients of the result, (count, n); at least m.
    """
    rows = coefficients
    while len(rows) < count:
        share = (np.arange(1, len(rows)) / len(rows))[:, None]
        between = rows[1:] + share * (rows[:-1] - rows[1:])
        rows = np.vstack([rows[:1], between, rows[-1:]])
    return rows
