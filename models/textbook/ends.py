"""What the textbook problems share: ends that are given."""

import casadi as ca
from numpy.typing import ArrayLike

from ocp import Constraint


def ends_at(expression: ca.SX, target: ArrayLike) -> tuple[Constraint, ...]:
    """Return the terminal equation ``expression = target``.

    Args:
        expression: (m,) in states and time.
        target: number or (m,).
    """
    return (Constraint("end", expression, target, target, at="terminal"),)
