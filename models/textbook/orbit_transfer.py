"""A spacecraft of low thrust: from a circular orbit to the largest that it can reach."""

import casadi as ca
import numpy as np

from ocp import OCP, Constraint, Guess, Model

# In units of the first orbit: its radius, its speed, the mass at the start.
THRUST, FLOW, TIME = 0.1405, 0.0749, 3.32


def orbit_transfer() -> OCP:
    r"""Reach the largest circular orbit in a given time, with a constant, low thrust.

    .. math::

        \max r(T), \quad \dot r = v, \;
        \dot v = \frac{w^2}{r} - \frac1{r^2} + \frac{0.1405 \sin u}{1 - 0.0749 t}, \;
        \dot w = -\frac{v w}{r} + \frac{0.1405 \cos u}{1 - 0.0749 t}, \quad
        (r, v, w): (1, 0, 1) \to (r, 0, 1/\sqrt r)

    T = 3.32, 193 days from the orbit of the Earth; v is the radial speed, w the other, u the angle
    of the thrust. Optimum: 1.5252777 (the cost is its negative): the thrust points outwards for
    the first half and inwards for the second. Problem: [Bryson & Ho 1975, section 2.5].
    """
    r, v, w, angle, t = (ca.SX.sym(name) for name in ("radius", "radial", "across", "angle", "t"))
    push = THRUST / (1.0 - FLOW * t)
    rate = ca.vertcat(
        v,
        w**2 / r - 1.0 / r**2 + push * ca.sin(angle),
        -v * w / r + push * ca.cos(angle),
    )
    circle = ca.vertcat(v, w - 1.0 / ca.sqrt(r))
    turn = np.concatenate([np.linspace(0.4, 2.4, 11), np.linspace(4.6, 5.9, 11)])
    return OCP(
        name="orbit transfer",
        model=Model(
            name="spacecraft", x=ca.vertcat(r, v, w), u=angle, f=rate, t=t, u_units=("rad",)
        ),
        x0=[1.0, 0.0, 1.0],
        horizon=TIME,
        terminal_cost=-r,
        constraints=(Constraint("circle", circle, 0.0, 0.0, at="terminal"),),
        guess=Guess(x=[[1.0, 0.0, 1.0], [1.2, 0.2, 0.9], [1.5, 0.0, 0.8]], u=turn[:, None]),
    )
