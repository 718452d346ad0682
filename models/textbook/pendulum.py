"""The pendulum: swing up with least effort, or with a torque too weak to lift it."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Model


def _model() -> Model:
    """A unit pendulum, g/l = 1/s², from hanging (0) to upright (pi)."""
    angle, rate, torque = ca.SX.sym("angle"), ca.SX.sym("rate"), ca.SX.sym("torque")
    return Model(
        name="pendulum",
        x=ca.vertcat(angle, rate),
        u=torque,
        f=ca.vertcat(rate, torque - ca.sin(angle)),
        x_units=("rad", "rad/s"),
        u_units=("N m",),
    )


def pendulum_swing_up() -> OCP:
    r"""Swing a pendulum up within 10 s, with least effort.

    .. math::

        \min \tfrac12 \int_0^{10} u^2 \, dt, \quad \ddot\theta = -\sin\theta + u, \quad
        (\theta, \dot\theta): (0, 0) \to (\pi, 0)

    Optimum: below; several extremals exist, one for each number of swings and each side. The
    cheapest pumps energy in phase with the swing, u roughly proportional to the rate.
    """
    model = _model()
    t = np.linspace(0.0, 1.0, 41)
    swing = np.stack([np.pi * t * np.cos(4.0 * np.pi * t * (1.0 - t)), 0.0 * t], axis=1)
    swing[-1] = np.pi, 0.0
    return OCP(
        name="pendulum, swing-up",
        model=model,
        x0=[0.0, 0.0],
        horizon=10.0,
        running_cost=model.u**2 / 2,
        constraints=ends_at(model.x, [np.pi, 0.0]),
        guess=Guess(x=swing, u=[0.0]),
    )


def pendulum_minimum_time() -> OCP:
    r"""Swing a pendulum up as fast as possible, with half the torque that would lift it.

    .. math::

        \min T, \quad \ddot\theta = -\sin\theta + u, \; |u| \le 1/2, \quad
        (\theta, \dot\theta): (0, 0) \to (\pi, 0)

    Optimum: bang-bang; u follows the sign of the costate of the rate.
    """
    model = _model()
    t = np.linspace(0.0, 1.0, 41)
    swing = np.stack([np.pi * t**2 * np.cos(np.pi * (1.0 - t) * 2), 0.0 * t], axis=1)
    return OCP(
        name="pendulum, minimum time",
        model=model,
        x0=[0.0, 0.0],
        horizon=FreeTime(guess=6.0, lower=1.0, upper=30.0),
        running_cost=1.0,
        control_bounds=Box(-0.5, 0.5),
        constraints=ends_at(model.x, [np.pi, 0.0]),
        guess=Guess(x=swing, u=[0.0], duration=6.0),
    )
