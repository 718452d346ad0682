"""The single integrator: free ends, a turnpike, mixed and moving constraints, in closed form."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, Constraint, FreeTime, Model


def _model() -> Model:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return Model(name="integrator", x=x, u=u, f=u)


def integrator_free_time() -> OCP:
    r"""Catch a target that runs away, at a time of one's choice.

    .. math::

        \min \tfrac12 \int_0^{T} u^2 \, dt, \quad \dot x = u, \quad x(0) = 0, \; x(T) = T + 10

    Optimum: 20 exactly. u is constant, u = (T + 10)/T, so the cost is (T + 10)²/(2T), least
    at T = 10 with u = 2. Costate -2.
    """
    model = _model()
    return OCP(
        name="integrator, free time",
        model=model,
        x0=[0.0],
        horizon=FreeTime(guess=5.0, lower=0.1, upper=100.0),
        running_cost=model.u**2 / 2,
        constraints=ends_at(model.x - model.t, 10.0),
    )


def integrator_free_time_quadratic() -> OCP:
    r"""Reach 1 for a price of time, place and effort.

    .. math::

        \min T + \tfrac12 \int_0^{T} x^2 + u^2 \, dt, \quad \dot x = u, \quad
        x(0) = 0, \; x(T) = 1

    Optimum: artanh(1/√3) + √3/2 = 1.524504. x = sinh t / sinh T, so the integral is
    coth(T)/2, and 1 = 1/(2 sinh² T) makes tanh T = 1/√3, coth T = √3. Costate -u(0) =
    -1/sinh T = -√2.
    """
    model = _model()
    return OCP(
        name="integrator, free time, quadratic",
        model=model,
        x0=[0.0],
        horizon=FreeTime(guess=1.0, lower=0.05, upper=10.0),
        running_cost=1.0 + (model.x**2 + model.u**2) / 2,
        constraints=ends_at(model.x, 1.0),
    )


def integrator_priced_end() -> OCP:
    r"""Come near zero for a price of what is missing.

    .. math::

        \min \tfrac12 \int_0^{10} u^2 \, dt + \tfrac52 x(10)^2, \quad \dot x = u, \quad
        x(0) = 3/2

    Optimum: 15/136 = 0.1102941 exactly. The costate is constant, u = -5 x(10), so that
    x(10) = 1.5/51, and the cost is 2.25 · 2.5/51. Costate 7.5/51. Problem: [Hull 2003].
    """
    model = _model()
    return OCP(
        name="integrator, priced end",
        model=model,
        x0=[1.5],
        horizon=10.0,
        running_cost=model.u**2 / 2,
        terminal_cost=2.5 * model.x**2,
    )


def turnpike() -> OCP:
    r"""Stay near zero as long as possible: bang, singular, bang.

    .. math::

        \min \int_0^2 x^2 \, dt, \quad \dot x = u, \; |u| \le 1, \quad x(0) = 1, \; x(2) = 1/2

    Optimum: 1/3 + 1/24 = 3/8 exactly. x falls at full speed to 0, rests there (singular), and
    rises at full speed in the last half second; no x can be nearer to 0 at any time.
    """
    model = _model()
    return OCP(
        name="turnpike",
        model=model,
        x0=[1.0],
        horizon=2.0,
        running_cost=model.x**2,
        control_bounds=Box(-1.0, 1.0),
        constraints=ends_at(model.x, 0.5),
    )


def mixed_constraint() -> OCP:
    r"""Rise as far as a constraint on state and control lets one.

    .. math::

        \min -\int_0^1 u \, dt, \quad \dot x = u, \; u \ge 0, \; x + u \le 0, \quad x(0) = -1

    Optimum: 1/e - 1 = -0.632121 exactly. The cost is x(0) - x(1), and \dot x <= -x lets x rise
    at most like -exp(-t).
    """
    model = _model()
    return OCP(
        name="mixed constraint",
        model=model,
        x0=[-1.0],
        horizon=1.0,
        running_cost=-model.u,
        control_bounds=Box(0.0, np.inf),
        constraints=(Constraint("sum", model.x + model.u, -np.inf, 0.0),),
    )


def moving_floor() -> OCP:
    r"""Rise late, when it is cheap, above a floor that rises and sinks.

    .. math::

        \min \int_0^3 e^{-t} u \, dt, \quad \dot x = u, \; 0 \le u \le 3, \;
        x \ge 1 - (t - 2)^2, \quad x(0) = 0

    Optimum: 2/e² = 0.270671 exactly. Waiting is free until the floor lifts x at t = 1, along it
    u = 2(2 - t) until its top at t = 2: the cost is the integral of 2(2 - t)e^{-t} over (1, 2).
    """
    model = _model()
    floor = model.x - 1.0 + (model.t - 2.0) ** 2
    return OCP(
        name="moving floor",
        model=model,
        x0=[0.0],
        horizon=3.0,
        running_cost=ca.exp(-model.t) * model.u,
        control_bounds=Box(0.0, 3.0),
        constraints=(Constraint("floor", floor, 0.0, np.inf),),
    )
