"""The double integrator: problems whose optimum is known in closed form."""

import casadi as ca
import numpy as np

from models._numbers import at_least
from ocp import OCP, Box, Constraint, FreeTime, Model, ProblemError


def _model(dt: float | None = None) -> Model:
    """Position [m] and velocity [m/s], driven by an acceleration [m/s^2]."""
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


def _ends_at(model: Model, position: float, velocity: float) -> tuple[Constraint, ...]:
    target = [position, velocity]
    return (Constraint("end", model.x, target, target, at="terminal"),)


def double_integrator_energy() -> OCP:
    r"""Move by 1 m in 1 s, from rest to rest, with least energy.

    .. math::

        \min \int_0^1 u^2/2 \, dt, \quad \ddot x = u, \quad (x, \dot x): (0, 0) \to (1, 0)

    Optimum: u* = 6 - 12 t, cost exactly 6. H_u = 0 makes u = -λ_2 linear in time, the ends
    fix its two constants; costates (-12, 12 t - 6).
    """
    model = _model()
    return OCP(
        name="double integrator, energy",
        model=model,
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=model.u**2 / 2,
        constraints=_ends_at(model, 1.0, 0.0),
    )


def double_integrator_minimum_time() -> OCP:
    r"""Move by 1 m from rest to rest as fast as possible.

    .. math::

        \min \int_0^{T} 1 \, dt, \quad \ddot x = u, \; |u| \le 1, \quad
        (x, \dot x): (0, 0) \to (1, 0)

    Optimum: u* = 1 for the first second and -1 for the second, T = 2 s exactly: with half
    of the way accelerated, T²/4 = 1.
    """
    model = _model()
    return OCP(
        name="double integrator, minimum time",
        model=model,
        x0=[0.0, 0.0],
        horizon=FreeTime(guess=1.0, lower=0.1, upper=10.0),
        running_cost=1.0,
        control_bounds=Box(-1.0, 1.0),
        constraints=_ends_at(model, 1.0, 0.0),
    )


def bryson_denham() -> OCP:
    r"""Turn round within 1/9 m, with least energy: a state constraint that gets active.

    .. math::

        \min \int_0^1 u^2/2 \, dt, \quad \ddot x = u, \; x \le l = 1/9, \quad
        (x, \dot x): (0, 1) \to (0, -1)

    Optimum: cost 4 / (9 l) = 4 exactly, with u* = -2/(3l) (1 - t/(3l)) up to t = 3 l = 1/3,
    0 on the boundary, and symmetric [Bryson & Ho 1975, section 3.11].
    """
    model = _model()
    return OCP(
        name="Bryson-Denham",
        model=model,
        x0=[0.0, 1.0],
        horizon=1.0,
        running_cost=model.u**2 / 2,
        state_bounds=Box([-np.inf, -np.inf], [1.0 / 9.0, np.inf]),
        constraints=_ends_at(model, 0.0, -1.0),
    )


def discrete_double_integrator(steps: int, dt: float) -> OCP:
    r"""Bring the sampled double integrator from (1, 0) to rest: a discrete-time regulator.

    .. math::

        \min \; x_N' x_N + \sum_{k=0}^{N-1} x_k' x_k + u_k^2, \quad
        x_{k+1} = \begin{pmatrix} 1 & \Delta t \\ 0 & 1 \end{pmatrix} x_k +
                  \begin{pmatrix} \Delta t^2/2 \\ \Delta t \end{pmatrix} u_k

    Optimum: x_0' P_0 x_0 with P from the Riccati recursion that starts at P_N = E (thesis
    2.39 with R where a misprint has P); costates 2 P_k x_k.

    Args:
        steps: N, at least 1.
        dt: step [s], positive.

    Raises:
        ProblemError: if one of them is not.
    """
    if steps != int(steps) or steps < 1:
        raise ProblemError(f"discrete double integrator: steps = {steps!r}, it must be 1 or more")
    model = _model(at_least(dt, 0.0, "discrete double integrator: dt", strictly=True))
    return OCP(
        name="discrete double integrator",
        model=model,
        x0=[1.0, 0.0],
        horizon=int(steps),
        running_cost=ca.sumsqr(model.x) + model.u**2,
        terminal_cost=ca.sumsqr(model.x),
    )
