"""A pendulum in Cartesian coordinates: the force of its rod is an algebraic variable."""

import casadi as ca

from models.textbook.ends import ends_at
from ocp import OCP, Guess, Model


def rod_pendulum() -> OCP:
    r"""Bring a pendulum from the side to rest below within three seconds, with least effort.

    A mass at the end of a rod of length 1; u pushes across the rod, z is the force of the rod:

    .. math::

        \min \int_0^3 u^2 dt, \quad \dot x = v, \; \dot y = w, \; \dot v = -2 x z + y u, \;
        \dot w = -9.81 - 2 y z - x u, \quad 0 = v^2 + w^2 - 2 z (x^2 + y^2) - 9.81 y

    The last equation is x^2 + y^2 = 1 differentiated twice, which leaves a DAE of index 1; the rod
    keeps its length along all trajectories. (x, y, v, w)(0) = (1, 0, 0, 0), (x, v)(3) = 0.

    Optimum: 12.873889; the same problem in the angle, phi'' = -9.81 sin phi - u, has the same one.
    Problem: [Betts 2010, example 10.103].
    """
    state, push, force = ca.SX.sym("x", 4), ca.SX.sym("push"), ca.SX.sym("force")
    x, y, v, w = ca.vertsplit(state)
    f = ca.vertcat(v, w, -2.0 * x * force + y * push, -9.81 - 2.0 * y * force - x * push)
    rod = v**2 + w**2 - 2.0 * force * (x**2 + y**2) - 9.81 * y
    return OCP(
        name="rod pendulum",
        model=Model(name="pendulum", x=state, u=push, f=f, z=force, algebraic=rod, z_guess=[0.0]),
        x0=[1.0, 0.0, 0.0, 0.0],
        horizon=3.0,
        running_cost=push**2,
        constraints=ends_at(state[[0, 2]], [0.0, 0.0]),
        guess=Guess(x=[[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0]], u=[0.0]),
    )
