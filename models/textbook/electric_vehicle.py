"""An electric vehicle on a hilly road."""

import casadi as ca

from models.textbook.ends import ends_at
from ocp import OCP, Model


def electric_vehicle() -> OCP:
    r"""Drive 10 units of a hilly road within 1, from rest to rest, with least energy.

    .. math::

        \min \int_0^1 10^3 (u v + u^2) \, dt, \quad \dot s = v, \;
        \dot v = u - 10^{-3} v^2 - 0.1 - (3 + 0.4 s - s^2 + 0.1 s^3), \quad
        (s, v): (0, 0) \to (10, 0)

    Optimum: smooth, without active constraints. Problem: [Petit & Sciarretta 2011].
    """
    s, v, u = ca.SX.sym("way"), ca.SX.sym("speed"), ca.SX.sym("motor")
    slope = 3.0 + 0.4 * s - s**2 + 0.1 * s**3
    state = ca.vertcat(s, v)
    return OCP(
        name="electric vehicle",
        model=Model(name="vehicle", x=state, u=u, f=ca.vertcat(v, u - 1e-3 * v**2 - 0.1 - slope)),
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=1e3 * (u * v + u**2),
        constraints=ends_at(state, [10.0, 0.0]),
    )
