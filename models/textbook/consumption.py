"""Spending what was saved, with discounted regret."""

import casadi as ca

from models.textbook.ends import ends_at
from ocp import OCP, Model


def consumption() -> OCP:
    r"""Spend all savings within ten years, always as near to 100 a year as can be.

    .. math::

        \min \int_0^{10} e^{-0.025 t} (c - 100)^2 dt, \quad \dot B = 0.05 B - c, \quad
        B: 100 \to 0

    Optimum: the costate is that of interest, e^{-0.05 t}, so c - 100 = k e^{-0.025 t}. All is spent
    if k (1 - e^{-0.75})/0.075 = 100 - 2000 (1 - e^{-0.5}), and the cost is
    k^2 (1 - e^{-0.75})/0.075 = 67075.65. Problem: [InfiniteOpt].
    """
    savings, spent, t = ca.SX.sym("savings"), ca.SX.sym("spent"), ca.SX.sym("t")
    return OCP(
        name="consumption",
        model=Model(name="savings", x=savings, u=spent, f=0.05 * savings - spent, t=t),
        x0=[100.0],
        horizon=10.0,
        running_cost=ca.exp(-0.025 * t) * (spent - 100.0) ** 2,
        constraints=ends_at(savings, 0.0),
    )
