"""A manifold in coordinates, near one of its points."""

from dataclasses import dataclass

import numpy as np

from solvers.indirect.reverse.invariant_manifold import Manifold

_ON = 1e-12
_MOST_STEPS = 20


@dataclass(frozen=True, eq=False)
class Chart:
    r"""Points :math:`x = \bar x + T s + J' w`, with w such that x lies on the manifold.

    T spans the tangent space at :math:`\bar x` and J is the slope of the equations there.

    Attributes:
        manifold: the set.
        base: a point on it (nx,).
        tangent: T (nx, n - m1).
        normal: J' (nx, m1).
    """

    manifold: Manifold
    base: np.ndarray
    tangent: np.ndarray
    normal: np.ndarray

    @classmethod
    def at(cls, manifold: Manifold, base: np.ndarray) -> "Chart":
        """Return the chart around a point of the manifold."""
        normal = manifold.linearised(base[None, :])[1][0].T
        return cls(manifold, base, manifold.tangent(base), normal)

    def point(self, s: np.ndarray) -> np.ndarray:
        """Return the point (nx,) at coordinates s; NaN beyond the chart."""
        x = self.base + self.tangent @ s
        for _ in range(_MOST_STEPS):
            values, slopes = self.manifold.linearised(x[None, :])
            if not np.isfinite(values).all():
                break
            if np.abs(values).max() <= _ON:
                return x
            x = x - self.normal @ _solved(slopes[0] @ self.normal, values[0])
        return np.full_like(x, np.nan)

    def slope(self, x: np.ndarray) -> np.ndarray:
        """Return dx/ds (nx, n - m1) at a point of the chart."""
        slope = self.manifold.linearised(x[None, :])[1][0]
        return self.tangent - self.normal @ _solved(slope @ self.normal, slope @ self.tangent)


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(matrix, right, rcond=None)[0]
