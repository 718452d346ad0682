"""A robot arm in spherical coordinates that slides through its joint."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Model

_LENGTH = 5.0


def polar_arm() -> OCP:
    r"""Turn an arm by 120° about the vertical, as fast as possible.

    .. math::

        \min T, \quad L \ddot\rho = u_1, \; I \sin^2\!\varphi \, \ddot\theta = u_2, \;
        I \ddot\varphi = u_3, \quad I = \frac{(L - \rho)^3 + \rho^3}{3}, \quad |u_i| \le 1,
        \quad (\rho, \theta, \varphi): (4.5, 0, \pi/4) \to (4.5, 2\pi/3, \pi/4)

    from rest to rest, L = 5, without gravity. Optimum: bang-bang in all three controls.
    Problem: [Dolan, More & Munson 2004].
    """
    q, rate, u = ca.SX.sym("q", 3), ca.SX.sym("rate", 3), ca.SX.sym("u", 3)
    inertia = ((_LENGTH - q[0]) ** 3 + q[0] ** 3) / 3.0
    turning = ca.vertcat(u[0] / _LENGTH, u[1] / (inertia * ca.sin(q[2]) ** 2), u[2] / inertia)
    state = ca.vertcat(q, rate)
    first = np.array([4.5, 0.0, np.pi / 4, 0.0, 0.0, 0.0])
    last = np.array([4.5, 2.0 * np.pi / 3.0, np.pi / 4, 0.0, 0.0, 0.0])
    return OCP(
        name="polar arm",
        model=Model(name="sliding arm", x=state, u=u, f=ca.vertcat(rate, turning)),
        x0=first,
        horizon=FreeTime(guess=8.0, lower=1.0, upper=30.0),
        running_cost=1.0,
        control_bounds=Box(-1.0, 1.0),
        state_bounds=Box(
            [0.0, -np.pi, 0.0, *[-np.inf] * 3], [_LENGTH, np.pi, np.pi, *[np.inf] * 3]
        ),
        constraints=ends_at(state, last),
        guess=Guess(x=np.linspace(first, last, 21), u=[0.0, 0.0, 0.0], duration=8.0),
    )
