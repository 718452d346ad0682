"""An overhead crane that carries its load across without a swing at the end."""

import casadi as ca

from models.textbook.ends import ends_at
from ocp import OCP, Model, Rate

# Gravity [m/s^2], length of the rope [m], distance [m], time [s].
GRAVITY, ROPE, DISTANCE, TIME = 9.81, 10.0, 10.0, 9.0


def overhead_crane() -> OCP:
    r"""Carry a load 10 m in 9 s, from rest to rest, as gently as possible.

    .. math::

        \min \int_0^9 \dot u^2 \, dt, \quad \ddot p = u, \;
        \ddot\theta = -(g \theta + u)/\ell, \quad
        (p, \dot p, \theta, \dot\theta): 0 \to (10, 0, 0, 0), \; u(0) = 0

    The trolley is at p, the load hangs at the small angle θ; the acceleration u of the trolley is
    continuous and its rate is what costs (a ``Rate``). In m, s, rad; g = 9.81, l = 10. Optimum: a
    quadratic form. With the state (p, p', θ, θ', u), dz/dt = A z + B r, and the rows C of its first
    four, the least ∫ r² that reaches d is d' (C W C')⁻¹ d, where W = ∫ exp(A s) B B' exp(A' s) ds
    over the 9 s. The linear crane is that of [Sakawa & Shindo 1982] at a constant length of the
    rope.
    """
    p, v, angle, swing, u = (
        ca.SX.sym(name) for name in ("position", "speed", "angle", "swing", "acceleration")
    )
    x = ca.vertcat(p, v, angle, swing)
    return OCP(
        name="overhead crane",
        model=Model(
            name="crane",
            x=x,
            u=u,
            f=ca.vertcat(v, u, swing, -(GRAVITY * angle + u) / ROPE),
            x_units=("m", "m/s", "rad", "rad/s"),
            u_units=("m/s^2",),
        ),
        x0=[0.0] * 4,
        horizon=TIME,
        constraints=ends_at(x, [DISTANCE, 0.0, 0.0, 0.0]),
        rates=(Rate(u, weight=1.0),),
        last_input=[0.0],
    )
