"""Where the end effector should be: any function of time."""

from collections.abc import Callable

import casadi as ca
from numpy.typing import ArrayLike

from models._numbers import returned_expression, vector
from ocp.internal import check_callable

# Time t [s], an SX, to the position (2,) [m].
Path = Callable[[ca.SX], ca.SX]


def line(start: ArrayLike, velocity: ArrayLike) -> Path:
    """Return the path start + t velocity.

    Args:
        start: position at t = 0 (2,) [m].
        velocity: (2,) [m/s].

    Raises:
        ProblemError: on a wrong size or NaN.
    """
    origin = ca.DM(vector(start, 2, "line: start"))
    rate = ca.DM(vector(velocity, 2, "line: velocity"))

    def position(t: ca.SX) -> ca.SX:
        return origin + t * rate

    return position


def path_position(path: Path, t: ca.SX) -> ca.SX:
    """Return the position at time ``t`` as an expression (2,) [m].

    Raises:
        ProblemError: if the path does not return two expressions or numbers.
    """
    check_callable(path, "path")
    return returned_expression(path(t), (2, 1), "path")


def path_velocity(path: Path, t: ca.SX) -> ca.SX:
    """Return the velocity along a path at the symbol ``t`` (2,) [m/s], derived symbolically."""
    return ca.densify(ca.jacobian(path_position(path, t), t))
