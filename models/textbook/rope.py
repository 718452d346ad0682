"""Dido's problem: the most land behind a rope of a given length."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Constraint, Guess, Model

# Angle that the best arc spans [rad]; the rope is as long as that arc over a chord of 1.
ANGLE = 2.0 * np.pi / 3.0
LENGTH = ANGLE / (2.0 * np.sin(ANGLE / 2.0))


def dido() -> OCP:
    r"""Enclose the largest area between a straight coast and a rope from (0, 0) to (1, 0).

    .. math::

        \max \int_0^1 x \, dt, \quad \dot x = u, \;
        \int_0^1 \sqrt{1 + u^2} \, dt = \frac{2\pi}{3\sqrt 3}, \quad x(0) = x(1) = 0

    Optimum: (θ - sin θ)/(8 sin²(θ/2)) = 0.20472828 with θ = 2π/3 (the cost is its negative): the
    rope is an arc of a circle. H = -x + μ √(1 + u²) + λ u is constant, λ' = 1 and
    μ u/√(1 + u²) = -λ is linear in t, so that the curvature is constant. The rope of length r θ
    over the chord 2 r sin(θ/2) = 1 spans the angle θ, and the area is that of a sector less that
    of its triangle. The length is a budget that is spent, a constraint of ``at="integral"``.
    Problem: [Kirk 1970, section 4.5].
    """
    height, slope = ca.SX.sym("height"), ca.SX.sym("slope")
    t = np.linspace(0.0, 1.0, 21)
    return OCP(
        name="Dido",
        model=Model(name="rope", x=height, u=slope, f=slope),
        x0=[0.0],
        horizon=1.0,
        running_cost=-height,
        constraints=(
            *ends_at(height, 0.0),
            Constraint("length", ca.sqrt(1.0 + slope**2), LENGTH, LENGTH, at="integral"),
        ),
        guess=Guess(x=(1.2 * t * (1.0 - t))[:, None], u=(1.2 * (1.0 - 2.0 * t))[:, None]),
    )
