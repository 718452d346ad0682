"""A planar arm of two links with its dynamics, driven by torques."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Model

_LENGTH, _MASS = 0.5, 1.0
_START, _TARGET = (0.0, 0.0), (np.pi / 2, np.pi / 4)


def _model() -> Model:
    r"""Two slender rods in a horizontal plane.

    M(q) q'' + c(q, q') = τ with m = 1 kg, l = 0.5 m, I = m l²/12, joints at the ends.
    """
    q, rate, torque = ca.SX.sym("q", 2), ca.SX.sym("rate", 2), ca.SX.sym("torque", 2)
    a = _MASS * _LENGTH**2
    cosine, sine = ca.cos(q[1]), ca.sin(q[1])
    far, coupled = a / 3.0, a / 2.0
    m11 = far + a + far + 2.0 * coupled * cosine
    m12 = far + coupled * cosine
    bend = coupled * sine
    forces = ca.vertcat(
        torque[0] + bend * (2.0 * rate[0] * rate[1] + rate[1] ** 2),
        torque[1] - bend * rate[0] ** 2,
    )
    determinant = m11 * far - m12**2
    acceleration = ca.vertcat(far * forces[0] - m12 * forces[1],
                              m11 * forces[1] - m12 * forces[0]) / determinant  # fmt: skip
    return Model(
        name="two-link arm",
        x=ca.vertcat(q, rate),
        u=torque,
        f=ca.vertcat(rate, acceleration),
        x_units=("rad", "rad", "rad/s", "rad/s"),
        u_units=("N m", "N m"),
    )


def _sweep() -> np.ndarray:
    """A cubic from rest to rest within 1 s, the shorter way round."""
    t = np.linspace(0.0, 1.0, 21)[:, None]
    way = np.array(_TARGET) - np.array(_START)
    return np.hstack([np.array(_START) + way * (3 * t**2 - 2 * t**3), way * 6 * (t - t**2)])


def two_link_arm_energy() -> OCP:
    r"""Turn an arm of two links from rest to rest within 1 s, with least squared torque.

    .. math::

        \min \tfrac12 \int_0^1 \tau'\tau \, dt, \quad M(q) \ddot q + c(q, \dot q) = \tau, \quad
        q: (0, 0) \to (\pi/2, \pi/4), \; \dot q: 0 \to 0

    Two slender rods of 0.5 m and 1 kg in a horizontal plane. Optimum: smooth. Equations of
    motion: [Bryson & Ho 1975] by Lagrange; their energy is tested.
    """
    model = _model()
    return OCP(
        name="two-link arm, energy",
        model=model,
        x0=[*_START, 0.0, 0.0],
        horizon=1.0,
        running_cost=ca.sumsqr(model.u) / 2,
        constraints=ends_at(model.x, [*_TARGET, 0.0, 0.0]),
        guess=Guess(x=_sweep(), u=[0.0, 0.0]),
    )


def two_link_arm_minimum_time() -> OCP:
    r"""The same motion as fast as possible, with bounded torques.

    .. math::

        \min T, \quad M(q) \ddot q + c(q, \dot q) = \tau, \;
        |\tau_1| \le 2, \; |\tau_2| \le 1 \text{ N m}

    Optimum: bang-bang in both torques.
    """
    model = _model()
    return OCP(
        name="two-link arm, minimum time",
        model=model,
        x0=[*_START, 0.0, 0.0],
        horizon=FreeTime(guess=1.0, lower=0.1, upper=10.0),
        running_cost=1.0,
        control_bounds=Box([-2.0, -1.0], [2.0, 1.0]),
        constraints=ends_at(model.x, [*_TARGET, 0.0, 0.0]),
        guess=Guess(x=_sweep(), u=[0.0, 0.0], duration=1.0),
    )
