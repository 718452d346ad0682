"""Fishing: how much to take from one stock, and from predator and prey."""

import casadi as ca

from ocp import OCP, Box, Model


def fishery() -> OCP:
    r"""Take fish so that the profit of ten years is largest.

    .. math::

        \max \int_0^{10} \Big(1 - \frac{17.5}{x}\Big) 20 u \, dt, \quad
        \dot x = 0.71 x \Big(1 - \frac{x}{80.5}\Big) - 20 u, \; 0 \le u \le 1, \quad x(0) = 70

    Optimum: full, singular, full. The singular stock is constant: with growth F and price
    q = 1 - 17.5/x, the derivative of F q vanishes there. The last switch is the best one. Problem:
    [GEKKO], [InfiniteOpt], after [Clark 1990].
    """
    stock, effort = ca.SX.sym("stock"), ca.SX.sym("effort")
    growth = 0.71 * stock * (1.0 - stock / 80.5)
    return OCP(
        name="fishery",
        model=Model(name="stock", x=stock, u=effort, f=growth - 20.0 * effort),
        x0=[70.0],
        horizon=10.0,
        running_cost=-(1.0 - 17.5 / stock) * 20.0 * effort,
        control_bounds=Box(0.0, 1.0),
        state_bounds=Box(lower=1.0),
    )


def predator_and_prey() -> OCP:
    r"""Fish in a pond of predator and prey so that both come to rest at 1.

    .. math::

        \min \int_0^{12} (x - 1)^2 + (y - 1)^2 dt, \quad \dot x = x - x y - 0.4 x u, \;
        \dot y = -y + x y - 0.2 y u, \; 0 \le u \le 1, \quad (x, y)(0) = (0.5, 0.7)

    Optimum: 1.344081; none, full, singular. Problem: [Sager 2005], whose control is 0 or 1; this is
    the relaxed one.
    """
    x, y, effort = ca.SX.sym("prey"), ca.SX.sym("predator"), ca.SX.sym("effort")
    return OCP(
        name="predator and prey",
        model=Model(
            name="pond",
            x=ca.vertcat(x, y),
            u=effort,
            f=ca.vertcat(x - x * y - 0.4 * x * effort, -y + x * y - 0.2 * y * effort),
        ),
        x0=[0.5, 0.7],
        horizon=12.0,
        running_cost=(x - 1.0) ** 2 + (y - 1.0) ** 2,
        control_bounds=Box(0.0, 1.0),
    )
