"""The brachistochrone: the curve of fastest descent."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, FreeTime, Guess, Model

GRAVITY = 9.8


def brachistochrone() -> OCP:
    r"""Slide without friction from rest to a point 2 m away and 2 m below, as fast as possible.

    .. math::

        \min T, \quad \dot x = v \sin\theta, \; \dot y = v \cos\theta, \;
        \dot v = g \cos\theta, \quad (x, y, v): (0, 0, 0) \to (2, 2, \cdot)

    y down [m], θ from the vertical [rad], g = 9.8 m/s². Optimum: a cycloid, x = a(φ - sin φ),
    y = a(1 - cos φ), passed at the constant rate θ = φ/2, φ = √(g/a) t. From (2, 2),
    φ - sin φ = 1 - cos φ has the root φ = 2.412011, a = 2/(1 - cos φ), and
    T = φ √(a/g) = 0.8247591.
    """
    x, y, v = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("v")
    angle = ca.SX.sym("angle")
    return OCP(
        name="brachistochrone",
        model=Model(
            name="bead",
            x=ca.vertcat(x, y, v),
            u=angle,
            f=ca.vertcat(v * ca.sin(angle), v * ca.cos(angle), GRAVITY * ca.cos(angle)),
            x_units=("m", "m", "m/s"),
            u_units=("rad",),
        ),
        x0=[0.0, 0.0, 0.0],
        horizon=FreeTime(guess=1.0, lower=0.1, upper=5.0),
        running_cost=1.0,
        constraints=ends_at(ca.vertcat(x, y), 2.0),
        guess=Guess(
            x=np.linspace([0.0, 0.0, 0.0], [2.0, 2.0, 6.0], 21),
            u=np.linspace([0.1], [1.2], 21),
            duration=1.0,
        ),
    )
