"""Zermelo's problem: a ship in a current."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, FreeTime, Guess, Model


def zermelo() -> OCP:
    r"""Steer a ship to the origin through a current that shears, as fast as possible.

    .. math::

        \min T, \quad \dot x = \cos\theta - y, \; \dot y = \sin\theta, \quad
        (x, y): (3.66, -1.86) \to (0, 0)

    Lengths in units of h, times in h/V. Optimum: T = τ_f - τ_0 = 5.4578653 with τ = tan θ,
    since the costate of x is constant and that of y, τ times it, has it as its rate: τ grows like
    the time. With S = √(1 + τ²) = -sec θ the ship's equations integrate over τ, and the ends give

    .. math::

        S_0 - S_f = 1.86, \quad
        \left[ \tfrac12 (\tau S - \operatorname{asinh} \tau) - S_f \tau \right]_0^f = -3.66

    Problem: [Bryson & Ho 1975, section 2.7, example 1].
    """
    x, y, heading = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("heading")
    position = ca.vertcat(x, y)
    straight = np.linspace([3.66, -1.86], [0.0, 0.0], 21)
    return OCP(
        name="Zermelo",
        model=Model(
            name="ship in a current",
            x=position,
            u=heading,
            f=ca.vertcat(ca.cos(heading) - y, ca.sin(heading)),
            x_units=("h", "h"),
            u_units=("rad",),
        ),
        x0=[3.66, -1.86],
        horizon=FreeTime(guess=5.0, lower=0.5, upper=20.0),
        running_cost=1.0,
        constraints=ends_at(position, 0.0),
        guess=Guess(x=straight, u=np.linspace([1.8], [4.2], 21), duration=5.0),
    )
