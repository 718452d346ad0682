r"""Splines as expressions, with derivatives of every order.

In the span of a knot, the spline of order p is

.. math:: S(x) = \sum_{r=0}^{p} B_r(x) \, c_{i + r}

with the basis functions B of that span [de Boor 1978]. Where x lies, i, is looked up and has no
derivative; all else is a formula. ``casadi.bspline`` is not used: at a knot its last derivative, a
spline of order 0, writes to memory that is not its own (CasADi 3.7).
"""

from collections.abc import Sequence
from functools import cache

import casadi as ca
import numpy as np
from scipy.interpolate import make_interp_spline


def spline(axes: Sequence[np.ndarray], values: np.ndarray, order: int, x: Sequence[ca.MX]) -> ca.MX:
    """Return the spline through samples on a grid, not-a-knot; in several arguments the product.

    At a knot its derivatives are those from the right, at the last one from the left; beyond the
    ends the outermost polynomial goes on.

    Args:
        axes: knots along each argument, increasing, more than the order.
        values: the samples, an entry for each combination of knots.
        order: 1 or 3.
        x: the arguments, scalars.
    """
    coefficients, knots = values, []
    for axis in axes:
        along = make_interp_spline(axis, coefficients, order)
        knots.append(along.t)
        # This axis last: after all of them their order is the first again.
        coefficients = np.moveaxis(along.c, 0, -1)
    weights, place, offsets, stride = ca.MX(1), ca.MX(0), np.zeros(1, dtype=int), 1
    for each, t, count in zip(x, knots, coefficients.shape, strict=True):
        span = ca.low(ca.DM(np.unique(t)), each)
        near = ca.MX(ca.DM(t))[span + ca.DM(np.arange(1, 2 * order + 1))]
        weights = ca.kron(_basis(order)(each, near), weights)
        place += stride * span
        offsets = np.add.outer(stride * np.arange(order + 1), offsets).ravel()
        stride *= count
    chosen = ca.MX(ca.DM(coefficients.ravel(order="F")))[place + ca.DM(offsets)]
    return ca.dot(chosen, weights)


@cache
def _basis(order: int) -> ca.Function:
    """(x, the 2p knots around its span) -> the p + 1 basis functions that do not vanish there."""
    x, t = ca.SX.sym("x"), ca.SX.sym("t", 2 * order)
    found = [ca.SX(1)]
    for j in range(1, order + 1):
        higher = [ca.SX(0)] * (j + 1)
        for r, each in enumerate(found):
            low, high = t[order - j + r], t[order + r]
            share = each / (high - low)
            higher[r] += (high - x) * share
            higher[r + 1] += (x - low) * share
        found = higher
    return ca.Function("basis", [x, t], [ca.vertcat(*found)])
