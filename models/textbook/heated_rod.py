"""A rod that is cooled at one end: a DAE, since its ends follow the inside at once."""

import casadi as ca
import numpy as np

from ocp import OCP, Model

# Nodes inside; distance; conductivity; what the surroundings take from the surface of an end.
NODES, CONDUCTIVITY, TRANSFER = 5, 0.2, 2.0
WIDTH = 1.0 / (NODES + 1)


def heated_rod() -> OCP:
    r"""Bring a rod of length 1 from temperature 1 to 0 by the surroundings of one end.

    Temperatures y inside (n = 5 nodes, h = 1/6 apart), z at both ends; the second end is
    insulated, at the first one conduction is what the surroundings at temperature u take:

    .. math::

        \min \int_0^2 h |y|^2 + 10^{-2} u^2 dt, \quad \dot y_i = \frac{0.2}{h^2}
        (y_{i-1} - 2 y_i + y_{i+1}), \quad 0 = \frac{y_1 - z_1}{h} - 2 (z_1 - u), \;
        0 = y_n - z_2

    with y_0 = z_1, y_{n+1} = z_2.

    Optimum: y(0)' K(0) y(0) of Riccati's equation after z is eliminated. Made after the heated rod
    of [Bonnans et al. 2017], whose control has no price.
    """
    y, z, u = ca.SX.sym("y", NODES), ca.SX.sym("z", 2), ca.SX.sym("surroundings")
    along = ca.vertcat(z[0], y, z[1])
    bent = along[:-2] - 2.0 * y + along[2:]
    ends = ca.vertcat((y[0] - z[0]) / WIDTH - TRANSFER * (z[0] - u), y[-1] - z[1])
    return OCP(
        name="heated rod",
        model=Model(
            name="rod",
            x=y,
            u=u,
            f=CONDUCTIVITY / WIDTH**2 * bent,
            z=z,
            algebraic=ends,
            z_guess=np.ones(2),
        ),
        x0=np.ones(NODES),
        horizon=2.0,
        running_cost=WIDTH * ca.sumsqr(y) + 1e-2 * u**2,
    )
