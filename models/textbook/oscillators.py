"""Nonlinear oscillators, and a stiff problem, with reference optima."""

import casadi as ca
import numpy as np

from ocp import OCP, Constraint, Model


def van_der_pol() -> OCP:
    r"""Damp the Van der Pol oscillator.

    .. math::

        \min \tfrac12 \int_0^2 x_1^2 + x_2^2 + u^2 \, dt, \quad
        \dot x_1 = x_2, \; \dot x_2 = (1 - x_1^2) x_2 - x_1 + u, \quad x(0) = (1, 0)

    Reference optimum: 1.047806908220, by indirect multiple shooting to a residual of 1e-14;
    1.047921, which is often printed, is an effect of a mesh.
    """
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    rate = ca.vertcat(x[1], (1.0 - x[0] ** 2) * x[1] - x[0] + u)
    return OCP(
        name="Van der Pol",
        model=Model(name="Van der Pol oscillator", x=x, u=u, f=rate),
        x0=[1.0, 0.0],
        horizon=2.0,
        running_cost=(ca.sumsqr(x) + u**2) / 2,
    )


def rayleigh() -> OCP:
    r"""Calm the Rayleigh oscillator (a tunnel-diode circuit).

    .. math::

        \min \int_0^{2.5} u^2 + x_1^2 \, dt, \quad
        \dot x_1 = x_2, \; \dot x_2 = -x_1 + x_2 (1.4 - 0.14 x_2^2) + 4 u, \quad
        x(0) = (-5, -5)

    Reference optimum: 29.376079655945, by indirect multiple shooting to a residual of 1e-14.
    Problem: [Maurer & Augustin 2001].
    """
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    rate = ca.vertcat(x[1], -x[0] + x[1] * (1.4 - 0.14 * x[1] ** 2) + 4.0 * u)
    return OCP(
        name="Rayleigh",
        model=Model(name="Rayleigh oscillator", x=x, u=u, f=rate),
        x0=[-5.0, -5.0],
        horizon=2.5,
        running_cost=u**2 + x[0] ** 2,
    )


def rayleigh_constrained() -> OCP:
    r"""Calm the Rayleigh oscillator in 4.5 s, with a constraint on state and control.

    .. math::

        \min \int_0^{4.5} u^2 + x_1^2 \, dt, \quad \dot x_1 = x_2, \;
        \dot x_2 = -x_1 + x_2 (1.4 - 0.14 x_2^2) + 4 u, \; u + x_1/6 \le 0, \quad
        x(0) = (-5, -5)

    Reference optimum: 44.804444908, by indirect shooting on its four arcs: the constraint acts
    until 1.27, and from 2.98 to 4.30. Problem: [Maurer & Augustin 2001], [Betts 2010, example
    4.10].
    """
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    rate = ca.vertcat(x[1], -x[0] + x[1] * (1.4 - 0.14 * x[1] ** 2) + 4.0 * u)
    return OCP(
        name="Rayleigh, constrained",
        model=Model(name="Rayleigh oscillator", x=x, u=u, f=rate),
        x0=[-5.0, -5.0],
        horizon=4.5,
        running_cost=u**2 + x[0] ** 2,
        constraints=(Constraint("mixed", u + x[0] / 6.0, -np.inf, 0.0),),
    )


def hypersensitive() -> OCP:
    r"""Fall to the origin, stay, and climb at the very end: the hypersensitive problem.

    .. math::

        \min \tfrac12 \int_0^{40} x^2 + u^2 \, dt, \quad \dot x = -x^3 + u, \quad
        x(0) = 1.5, \; x(40) = 1

    Reference optimum: 1.330806904945, by indirect multiple shooting. Single shooting is
    hopeless: errors of the start grow as e^40. Problem: [Rao & Mease 2000].
    """
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return OCP(
        name="hypersensitive",
        model=Model(name="cubic damper", x=x, u=u, f=-(x**3) + u),
        x0=[1.5],
        horizon=40.0,
        running_cost=(x**2 + u**2) / 2,
        constraints=(Constraint("end", x, 1.0, 1.0, at="terminal"),),
    )
