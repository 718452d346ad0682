"""Steering with the linear tangent law: a thrust of constant size, turned."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Model

ACCELERATION = 100.0


def linear_tangent_steering() -> OCP:
    r"""Rise to a height and a horizontal speed as fast as possible, by turning the thrust.

    .. math::

        \min T, \quad \ddot x = a \cos\theta, \; \ddot y = a \sin\theta, \quad
        x, y, \dot x, \dot y: 0 \to (\cdot, 5, 45, 0)

    a = 100, -π/2 <= θ <= π/2. Optimum: T = 0.5545709. The costate of the vertical speed is linear
    in time and that of the horizontal speed constant: tan θ = tan θ_0 (1 - 2t/T), antisymmetric
    because the vertical speed returns to 0. With τ = tan θ_0 and σ = asinh τ,

    .. math::

        \dot x(T) = a T \sigma/\tau = 45, \quad
        y(T) = \frac{a T^2}{4 \tau^2} (\tau \sqrt{1 + \tau^2} - \sigma) = 5

    (y(T) is the integral of (T - t) a sin θ). Problem: [Bryson & Ho 1975, section 2.7];
    [Dolan, More & Munson 2004].
    """
    x = ca.vertcat(*[ca.SX.sym(name) for name in ("x", "y", "x rate", "y rate")])
    angle = ca.SX.sym("angle")
    push = ACCELERATION * ca.vertcat(ca.cos(angle), ca.sin(angle))
    return OCP(
        name="linear tangent steering",
        model=Model(
            name="point mass",
            x=x,
            u=angle,
            f=ca.vertcat(x[2:], push),
            u_units=("rad",),
        ),
        x0=np.zeros(4),
        horizon=FreeTime(guess=0.6, lower=0.1, upper=5.0),
        running_cost=1.0,
        control_bounds=Box(-np.pi / 2, np.pi / 2),
        constraints=ends_at(x[1:], [5.0, 45.0, 0.0]),
        guess=Guess(u=np.linspace([1.0], [-1.0], 21), duration=0.6),
    )
