"""The double integrator: problems whose optimum is known in closed form."""

import casadi as ca

from models.textbook.ends import ends_at
from models.textbook.mass import mass
from ocp import OCP, Box, FreeTime, Model
from ocp.internal import check_positive, check_whole


def double_integrator_energy() -> OCP:
    r"""Move by 1 m in 1 s, from rest to rest, with least energy.

    .. math::

        \min \int_0^1 u^2/2 \, dt, \quad \ddot x = u, \quad (x, \dot x): (0, 0) \to (1, 0)

    Optimum: u* = 6 - 12 t, cost exactly 6. H_u = 0 makes u = -λ_2 linear in time, the ends
    fix its two constants; costates (-12, 12 t - 6).
    """
    model = mass()
    return OCP(
        name="double integrator, energy",
        model=model,
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=model.u**2 / 2,
        constraints=ends_at(model.x, [1.0, 0.0]),
    )


def double_integrator_minimum_time() -> OCP:
    r"""Move by 1 m from rest to rest as fast as possible.

    .. math::

        \min \int_0^{T} 1 \, dt, \quad \ddot x = u, \; |u| \le 1, \quad
        (x, \dot x): (0, 0) \to (1, 0)

    Optimum: u* = 1 for the first second and -1 for the second, T = 2 s exactly: with half
    of the way accelerated, T²/4 = 1.
    """
    model = mass()
    return OCP(
        name="double integrator, minimum time",
        model=model,
        x0=[0.0, 0.0],
        horizon=FreeTime(guess=1.0, lower=0.1, upper=10.0),
        running_cost=1.0,
        control_bounds=Box(-1.0, 1.0),
        constraints=ends_at(model.x, [1.0, 0.0]),
    )


def double_integrator_bounded_energy() -> OCP:
    r"""The same motion with least energy and an acceleration that is bounded.

    .. math::

        \min \int_0^1 u^2/2 \, dt, \quad \ddot x = u, \; |u| \le 5, \quad
        (x, \dot x): (0, 0) \to (1, 0)

    Optimum: 25/2 - (50/3) √(3/20) = 6.045028 exactly. u is 5 s/w clipped to ±5 with the
    time s = 1/2 - t left to the middle: the way is 2∫ s u ds over (0, 1/2) = 10 (1/8 - w²/6) = 1,
    so w² = 3/20; the cost is 25 (1/2 - 2w/3). Costates (-5/w, -5/(2w)).
    """
    model = mass()
    return OCP(
        name="double integrator, bounded energy",
        model=model,
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=model.u**2 / 2,
        control_bounds=Box(-5.0, 5.0),
        constraints=ends_at(model.x, [1.0, 0.0]),
    )


def double_integrator_fuel() -> OCP:
    r"""The same motion with least fuel: push, coast, brake.

    .. math::

        \min \int_0^1 u_+ + u_- \, dt, \quad \ddot x = u_+ - u_-, \; 0 \le u_\pm \le 5, \quad
        (x, \dot x): (0, 0) \to (1, 0)

    Optimum: 5 - √5 = 2.763932 exactly: pushes of 5 m/s² for τ at both ends move by 5τ(1 - τ) = 1,
    so τ = (1 - 1/√5)/2, and the cost is 10τ.
    """
    x, v = ca.SX.sym("position"), ca.SX.sym("velocity")
    push = ca.vertcat(ca.SX.sym("forward"), ca.SX.sym("backward"))
    model = Model(
        name="double integrator with two thrusters",
        x=ca.vertcat(x, v),
        u=push,
        f=ca.vertcat(v, push[0] - push[1]),
        x_units=("m", "m/s"),
        u_units=("m/s^2", "m/s^2"),
    )
    return OCP(
        name="double integrator, fuel",
        model=model,
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=push[0] + push[1],
        control_bounds=Box(0.0, 5.0),
        constraints=ends_at(model.x, [1.0, 0.0]),
    )


def double_integrator_distance() -> OCP:
    r"""Get far with little energy; the end is free.

    .. math::

        \min -\tfrac12 x(1) + \tfrac12 \int_0^1 u^2 \, dt, \quad \ddot x = u, \quad
        (x, \dot x)(0) = (0, 0)

    Optimum: -1/24 exactly, with u = (1 - t)/2: the push at t moves x(1) by 1 - t. Costates
    (-1/2, -(1 - t)/2).
    """
    model = mass()
    return OCP(
        name="double integrator, distance",
        model=model,
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=model.u**2 / 2,
        terminal_cost=-model.x[0] / 2,
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
    check_whole(steps, "discrete double integrator: steps")
    model = mass(check_positive(dt, "discrete double integrator: dt"))
    return OCP(
        name="discrete double integrator",
        model=model,
        x0=[1.0, 0.0],
        horizon=steps,
        running_cost=ca.sumsqr(model.x) + model.u**2,
        terminal_cost=ca.sumsqr(model.x),
    )
