"""A mass on a line: the plant of many textbook problems."""

import casadi as ca

from ocp import Model


def mass(dt: float | None = None) -> Model:
    r"""Return the double integrator.

    .. math:: \ddot x = u

    States position [m] and velocity [m/s], control acceleration [m/s^2].

    Args:
        dt: step [s] of its exact discretisation with held control; None: continuous time.
    """
    x, v, u = ca.SX.sym("position"), ca.SX.sym("velocity"), ca.SX.sym("acceleration")
    rate = ca.vertcat(v, u)
    after = ca.vertcat(x + (dt or 0.0) * v + (dt or 0.0) ** 2 / 2 * u, v + (dt or 0.0) * u)
    return Model(
        name="double integrator",
        x=ca.vertcat(x, v),
        u=u,
        f=rate if dt is None else after,
        dt=dt,
        x_units=("m", "m/s"),
        u_units=("m/s^2",),
    )
