"""The linear hypersensitive problem: two boundary layers, and a closed form."""

import casadi as ca

from models.textbook.ends import ends_at
from ocp import OCP, Model


def linear_hypersensitive() -> OCP:
    r"""Fall to the origin, stay, and climb at the very end, with linear dynamics.

    .. math::

        \min \tfrac12 \int_0^{40} x^2 + u^2 \, dt, \quad \dot x = -x + u, \quad
        x(0) = 3/2, \; x(40) = 1

    Optimum: ((√2 - 1) x(0)² + (√2 + 1) x(40)²)/2 = 1.673097 up to e^{-40√2} = 3e-25. The flow of
    state and costate has the rates ±√2; u = -λ makes λ = -x - \dot x, that is (√2 - 1) x in the
    layer that decays and -(√2 + 1) x in the one that grows; along an extremal of a quadratic
    problem the cost is (λ(0)x(0) - λ(40)x(40))/2.
    """
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return OCP(
        name="linear hypersensitive",
        model=Model(name="decay", x=x, u=u, f=u - x),
        x0=[1.5],
        horizon=40.0,
        running_cost=(x**2 + u**2) / 2,
        constraints=ends_at(x, 1.0),
    )
