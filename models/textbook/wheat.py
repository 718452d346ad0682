"""Trading wheat at prices that are known."""

import casadi as ca
import numpy as np

from ocp import OCP, Box, Model


def wheat() -> OCP:
    r"""Buy and sell wheat at prices that are known, so that most is owned at the end.

    Cash c and wheat w, neither of which may be negative, bought b and sold s:

    .. math::

        \max c(12) + p(12) w(12), \quad \dot c = 0.01 c - 0.2 w - p (b + s) - 0.01 b + 0.05 s, \;
        \dot w = -0.05 w + b + s

    with p = 1 - cos(pi t/3)/2, sin(pi t/3 + 3 pi/2) = -cos(pi t/3), 0 <= b <= 1, -1 <= s <= 0,
    (c, w)(0) = (1, 0).

    Optimum: 1.75; bang-bang, with arcs along c = 0. Problem: [Becerra 2010], after
    [Ijiri & Thompson 1970].
    """
    cash, stock, t = ca.SX.sym("cash"), ca.SX.sym("wheat"), ca.SX.sym("t")
    bought, sold = ca.SX.sym("bought"), ca.SX.sym("sold")
    price = 1.0 - 0.5 * ca.cos(np.pi * t / 3.0)
    rate = 0.01 * cash - 0.2 * stock - price * (bought + sold) - 0.01 * bought + 0.05 * sold
    return OCP(
        name="wheat",
        model=Model(
            name="trader",
            x=ca.vertcat(cash, stock),
            u=ca.vertcat(bought, sold),
            f=ca.vertcat(rate, -0.05 * stock + bought + sold),
            t=t,
        ),
        x0=[1.0, 0.0],
        horizon=12.0,
        terminal_cost=-(cash + price * stock),
        control_bounds=Box([0.0, -1.0], [1.0, 0.0]),
        state_bounds=Box(lower=[0.0, 0.0]),
    )
