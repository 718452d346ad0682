"""A state that decays by itself: least energy, least fuel, least time, in closed form."""

import casadi as ca

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Model


def exponential_energy() -> OCP:
    r"""Bring a decaying state to zero with least energy.

    .. math::

        \min \tfrac12 \int_0^1 u^2 \, dt, \quad \dot x = -x + u, \quad x(0) = -1, \; x(1) = 0

    Optimum: 1/(e² - 1) = 0.156518 exactly. u = c e^t, since the costate grows like e^t;
    x(1) = -1/e + c sinh 1 = 0 gives c = 2/(e² - 1), and the cost is c²(e² - 1)/4.
    Costate -c.
    """
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return OCP(
        name="exponential, energy",
        model=Model(name="decay", x=x, u=u, f=u - x),
        x0=[-1.0],
        horizon=1.0,
        running_cost=u**2 / 2,
        constraints=ends_at(x, 0.0),
    )


def exponential_fuel() -> OCP:
    r"""Bring a decaying state to zero with least fuel: wait, then push.

    .. math::

        \min \int_0^1 u \, dt, \quad \dot x = -x + u, \; 0 \le u \le 1, \quad
        x(0) = -1, \; x(1) = 0

    Optimum: 1 - ln(e - 1) = 0.458675 exactly. A push at t moves x(1) by e^{t-1}: late ones are
    better. Pushing from s on, 1 - e^{s-1} = 1/e, so s = ln(e - 1).
    """
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return OCP(
        name="exponential, fuel",
        model=Model(name="decay", x=x, u=u, f=u - x),
        x0=[-1.0],
        horizon=1.0,
        running_cost=u,
        control_bounds=Box(0.0, 1.0),
        constraints=ends_at(x, 0.0),
    )


def exponential_minimum_time() -> OCP:
    r"""Bring a decaying state to zero as fast as possible.

    .. math::

        \min T, \quad \dot x = -x + u, \; |u| \le 1, \quad x(0) = -1, \; x(T) = 0

    Optimum: ln 2 exactly: with u = 1 throughout x = 1 - 2 e^{-t}. Costate -1/2.
    """
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return OCP(
        name="exponential, minimum time",
        model=Model(name="decay", x=x, u=u, f=u - x),
        x0=[-1.0],
        horizon=FreeTime(guess=1.0, lower=0.05, upper=10.0),
        running_cost=1.0,
        control_bounds=Box(-1.0, 1.0),
        constraints=ends_at(x, 0.0),
    )
