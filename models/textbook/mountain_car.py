"""A car in a valley, too weak to drive straight up: it has to swing first."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Model

ENGINE, SLOPE, WAVES = 1e-3, 2.5e-3, 3.0
START, GOAL = -0.5, 0.5


def mountain_car() -> OCP:
    r"""Reach the top of the hill as fast as possible.

    .. math::

        \min T, \quad \dot p = v, \; \dot v = u/1000 - \cos(3 p)/400, \; |u| \le 1, \quad
        (p, v): (-1/2, 0) \to (1/2, \cdot)

    Optimum: 102.36754, back up the other hill first, then down and up with full force; u switches
    twice. A car that does not swing often enough does not arrive, one that swings more often is
    slower. The bounds of place and speed of the source are met by themselves. Problem:
    [Melnikov, Makmal & Briegel 2014], as an example of dymos.
    """
    position, speed, push = (ca.SX.sym(name) for name in ("position", "speed", "push"))
    x = ca.vertcat(position, speed)
    t = np.linspace(0.0, 1.0, 31)
    swing = START - 0.7 * t**2 * np.sin(3.0 * np.pi * t) + t**4
    return OCP(
        name="mountain car",
        model=Model(
            name="car",
            x=x,
            u=push,
            f=ca.vertcat(speed, ENGINE * push - SLOPE * ca.cos(WAVES * position)),
            x_nominal=[1.0, 0.05],
        ),
        x0=[START, 0.0],
        horizon=FreeTime(guess=100.0, lower=20.0, upper=300.0),
        running_cost=1.0,
        control_bounds=Box(-1.0, 1.0),
        constraints=ends_at(position, GOAL),
        guess=Guess(
            x=np.stack([swing, np.gradient(swing, 100.0 * t)], axis=1),
            u=[[1.0], [-1.0], [1.0]],
            duration=100.0,
        ),
    )
