"""The undamped oscillator as a linear-quadratic problem."""

import casadi as ca

from ocp import OCP, Model


def oscillator_regulator() -> OCP:
    r"""Calm an undamped oscillator within 5 s: linear-quadratic.

    .. math::

        \min \tfrac12 \int_0^5 x_1^2 + x_2^2 + u^2 \, dt, \quad
        \dot x_1 = x_2, \; \dot x_2 = -x_1 + u, \quad x(0) = (0, 1)

    Optimum: x(0)'P x(0)/2 = 0.6739990 with λ = P x. The flow of (x, λ) is linear, exp(5 M) = ((Φ11,
    Φ12), (Φ21, Φ22)), and λ(5) = Φ21 x(0) + Φ22 λ(0) = 0 gives P = -Φ22^{-1} Φ21.
    """
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    return OCP(
        name="oscillator, regulator",
        model=Model(name="oscillator", x=x, u=u, f=ca.vertcat(x[1], u - x[0])),
        x0=[0.0, 1.0],
        horizon=5.0,
        running_cost=(ca.sumsqr(x) + u**2) / 2,
    )
