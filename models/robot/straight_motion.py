"""The straight line between two configurations: where the search for a motion begins."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from models.robot.robot import Robot
from ocp import Parameter, Signal

# More change nothing: it is smooth.
_SAMPLES = 21


def straight_motion(
    robot: Robot,
    start: np.ndarray,
    goal: np.ndarray,
    horizon: float,
    parameters: Sequence[Parameter | Signal] = (),
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Return a motion that starts and ends at rest and without acceleration.

    .. math:: q = q_0 + (q_1 - q_0) (10 s^3 - 15 s^4 + 6 s^5), \quad s = t / T

    Args:
        robot: that moves.
        start: q_0 (n,).
        goal: q_1 (n,).
        horizon: T [s].
        parameters: of what in the robot is a symbol; their values count, of signals the first.

    Returns:
        States (q, q') (N + 1, 2 n), accelerations and efforts (N + 1, n), equally spaced in time.
    """
    s = np.linspace(0.0, 1.0, _SAMPLES)[:, None]
    way = goal - start
    q = start + way * (10 * s**3 - 15 * s**4 + 6 * s**5)
    v = way * (30 * s**2 - 60 * s**3 + 30 * s**4) / horizon
    a = way * (60 * s - 180 * s**2 + 120 * s**3) / horizon**2
    x = [ca.SX.sym(letter, robot.n) for letter in "qva"]
    symbols = [entry.symbol for entry in parameters]
    needed = ca.Function("needed", [*x, *symbols], [robot.inverse_dynamics(*x)])
    values: list[Any] = [
        entry.value if isinstance(entry, Parameter) else np.atleast_2d(entry.samples)[0]
        for entry in parameters
    ]
    rows = zip(q, v, a, strict=True)
    efforts = np.array([np.array(needed(*row, *values)).ravel() for row in rows])
    return np.hstack([q, v]), a, efforts
