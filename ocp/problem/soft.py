"""What exceeds a constraint: its price, and rows that allow it."""

from collections.abc import Iterable, Iterator

import casadi as ca
import numpy as np

from ocp.problem.constraint import Box, Constraint


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


def slackened(
    expression: ca.SX, box: Box, slack: ca.SX
) -> Iterator[tuple[list[int], ca.SX, np.ndarray, np.ndarray]]:
    """Yield lower - slack <= expression <= upper + slack: first what is bounded above, then below.

    Each time: which rows, their expression, its lower and its upper bounds.
    """
    lower, upper = np.asarray(box.lower), np.asarray(box.upper)
    above, below = (np.flatnonzero(np.isfinite(side)).tolist() for side in (upper, lower))
    yield above, (expression - slack)[above, :], np.full(len(above), -np.inf), upper[above]
    yield below, (expression + slack)[below, :], lower[below], np.full(len(below), np.inf)


def _outside(value: ca.SX, low: float, high: float) -> ca.SX:
    if low == high:
        return value - low
    sides = [value - high] * bool(np.isfinite(high)) + [low - value] * bool(np.isfinite(low))
    outside = ca.SX(0)
    for side in sides:
        outside = ca.fmax(outside, side)
    return outside
