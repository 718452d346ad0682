"""Two burns with a coast between them, into a circular orbit of three times the radius."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Model, Phases

# In units of the first orbit: speed of the exhaust, thrust over mass at the start, last radius.
EXHAUST, PUSH, RADIUS = 1.5, 0.1, 3.0
_AROUND = [RADIUS, 0.0, 1.0 / np.sqrt(RADIUS)]

R, V, W, A, U = (ca.SX.sym(name) for name in ("radius", "radial", "across", "push", "angle"))


def orbit_raise() -> Phases:
    r"""Raise a circular orbit to three times its radius, with as little fuel as possible.

    .. math::

        \min c \ln\frac{a(T)}{0.1}, \quad \dot r = v, \;
        \dot v = \frac{w^2}{r} - \frac1{r^2} + a \sin u, \;
        \dot w = -\frac{v w}{r} + a \cos u, \; \dot a = \frac{a^2}{c}, \quad
        (r, v, w, a): (1, 0, 1, 0.1) \to (3, 0, 1/\sqrt 3, \cdot)

    with c = 1.5, v the radial speed, w the other, u the angle of the thrust, and a its
    acceleration, which grows as fuel is burnt. In three phases of free durations: a burn with
    \|u\| <= 30°, a coast in which a does not act and rests, a second burn. The cost is what the
    speed changes by. Optimum: 0.39948783, twice through about 0.2. Problem: an example of dymos,
    after [Enright 1991].
    """
    burn = Model(
        name="burn",
        x=ca.vertcat(R, V, W, A),
        u=U,
        f=ca.vertcat(_pull(A * ca.sin(U), A * ca.cos(U)), A**2 / EXHAUST),
        u_units=("rad",),
    )
    coast = Model(name="coast", x=burn.x, u=ca.SX(0, 1), f=ca.vertcat(_pull(0.0, 0.0), 0.0))
    path = np.array(
        [[1.0, 0.0, 1.0, 0.1], [1.3, 0.3, 1.0, 0.12], [2.8, 0.2, 0.4, 0.12], [*_AROUND, 0.13]]
    )
    first = OCP(
        name="first burn",
        model=burn,
        x0=path[0],
        horizon=FreeTime(guess=2.2, lower=0.5, upper=10.0),
        control_bounds=Box(-np.radians(30.0), np.radians(30.0)),
        guess=Guess(x=path[:2]),
    )
    between = OCP(
        name="coast",
        model=coast,
        x0=path[1],
        horizon=FreeTime(guess=5.0, lower=0.5, upper=50.0),
        guess=Guess(x=path[1:3]),
    )
    second = OCP(
        name="second burn",
        model=burn,
        x0=path[2],
        horizon=FreeTime(guess=1.5, lower=0.5, upper=10.0),
        terminal_cost=EXHAUST * ca.log(A / PUSH),
        control_bounds=Box(-np.pi, np.pi),
        constraints=ends_at(burn.x[:3], _AROUND),
        guess=Guess(x=path[2:]),
    )
    return Phases("orbit raise", (first, between, second))


def _pull(outwards: ca.SX | float, across: ca.SX | float) -> ca.SX:
    """Return the rates of radius and speeds."""
    return ca.vertcat(V, W**2 / R - 1.0 / R**2 + outwards, -V * W / R + across)
