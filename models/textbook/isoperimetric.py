"""An isoperimetric problem: a budget of effort that has to be spent."""

import casadi as ca

from models.textbook.ends import ends_at
from ocp import OCP, Box, Guess, Model


def isoperimetric() -> OCP:
    r"""Push a state down as far as a budget of effort reaches.

    .. math::

        \min \int_0^1 x \, dt, \quad \dot x = -\sin x + u, \; \dot w = u^2, \; |u| \le 4, \quad
        (x, w): (1, 0) \to (0, 10)

    Optimum: the bound on u acts at the end. Problem: [Rutquist & Edvall 2010].
    """
    x, spent, u = ca.SX.sym("x"), ca.SX.sym("spent"), ca.SX.sym("u")
    state = ca.vertcat(x, spent)
    return OCP(
        name="isoperimetric",
        model=Model(name="budget", x=state, u=u, f=ca.vertcat(u - ca.sin(x), u**2)),
        x0=[1.0, 0.0],
        horizon=1.0,
        running_cost=x,
        control_bounds=Box(-4.0, 4.0),
        constraints=ends_at(state, [0.0, 10.0]),
        guess=Guess(u=[[-4.0], [4.0]]),
    )
