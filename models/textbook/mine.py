"""A mine that is to be emptied for profit."""

import casadi as ca

from ocp import OCP, Box, Guess, Model


def mine() -> OCP:
    r"""Dig ore while it is cheap to dig: the cost grows as the mine becomes empty.

    .. math:: \min \int_0^2 \frac{u^2}{x} - u \, dt, \quad \dot x = -u, \; u \ge 0, \quad x(0) = 10

    Optimum: -10/3. The cost to go is -K(t) x, and Bellman's equation leaves K' = -(1 - K)^2/4 with
    K(2) = 0: 1 - K = 4/(6 - t). So u = 2 x/(6 - t), x = 10 (1 - t/6)^2, and K(0) = 1/3. Problem:
    [DT QP].
    """
    ore, rate = ca.SX.sym("ore"), ca.SX.sym("rate")
    return OCP(
        name="mine",
        model=Model(name="mine", x=ore, u=rate, f=-rate),
        x0=[10.0],
        horizon=2.0,
        running_cost=rate**2 / ore - rate,
        control_bounds=Box(lower=0.0),
        guess=Guess(u=[1.0]),
    )
