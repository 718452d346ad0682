"""The price of what exceeds a soft constraint."""

from collections.abc import Iterable

import casadi as ca
import numpy as np

from ocp.problem.constraint import Constraint


def excess(c: Constraint) -> ca.SX:
    """Return by how much each row lies outside its bounds, (m,); of an equation with its sign."""
    rows = zip(ca.vertsplit(c.expression), np.asarray(c.lower), np.asarray(c.upper), strict=True)
    return ca.vertcat(*[_outside(value, float(low), float(high)) for value, low, high in rows])


def price(constraints: Iterable[Constraint]) -> ca.SX:
    """Return what the excess of soft constraints costs: per second, or at the end."""
    total = ca.SX(0)
    for c in constraints:
        if c.soft is not None:
            total += c.soft.cost(ca.fabs(excess(c)))
    return total


def _outside(value: ca.SX, low: float, high: float) -> ca.SX:
    if low == high:
        return value - low
    sides = [value - high] * bool(np.isfinite(high)) + [low - value] * bool(np.isfinite(low))
    outside = ca.SX(0)
    for side in sides:
        outside = ca.fmax(outside, side)
    return outside
