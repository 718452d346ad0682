"""A ball that hits the ground twice and comes back to the hand."""

import casadi as ca

from ocp import OCP, Constraint, FreeTime, Link, Model, Phases

GRAVITY, BOUNCE, HEIGHT, TOTAL = 9.81, 0.8, 1.0, 2.5


def bouncing_ball() -> Phases:
    r"""Let a ball go at 1 m, and have it back there, at rest, after two impacts and 2.5 s.

    .. math::

        \min \tfrac12 \int u^2 \, dt, \quad \ddot h = u - 9.81, \quad
        (h, \dot h): (1, 0) \to (0, -v_1), \; (0, 0.8 v_1) \to (0, -v_2), \; (0, 0.8 v_2) \to (1, 0)

    In three phases that take T_1 + T_2 + T_3 = 2.5 s; an impact leaves 0.8 of the speed (a
    ``Link``). In m and s. Optimum: 14.76123. Between ends that are given the best acceleration
    a = u - g is linear in time. With the distance d, the speeds v and w at the ends and the time T

    .. math::

        \int \tfrac12 a^2 \, dt = \frac{2 (v^2 + v w + w^2)}{T} - \frac{6 d (v + w)}{T^2}
            + \frac{6 d^2}{T^3}, \quad \int g a + \tfrac12 g^2 \, dt = g (w - v) + \tfrac12 g^2 T

    and the sum over the phases is least over v_1, v_2 and two of the times.
    """
    h, v, push = (ca.SX.sym(name) for name in ("height", "speed", "push"))
    model = Model(
        name="ball",
        x=ca.vertcat(h, v),
        u=push,
        f=ca.vertcat(v, push - GRAVITY),
        x_units=("m", "m/s"),
        u_units=("N/kg",),
    )
    ground = Constraint("ground", h, 0.0, 0.0, at="terminal")
    hand = Constraint("hand", model.x, [HEIGHT, 0.0], [HEIGHT, 0.0], at="terminal")
    phases = tuple(
        OCP(
            name=name,
            model=model,
            x0=start,
            horizon=FreeTime(guess=time, lower=0.1, upper=TOTAL),
            running_cost=push**2 / 2,
            constraints=(end,),
        )
        for name, start, time, end in (
            ("fall", [HEIGHT, 0.0], 0.5, ground),
            ("bounce", [0.0, 4.0], 1.0, ground),
            ("rise", [0.0, 4.0], 1.0, hand),
        )
    )
    impact = Link(ca.vertcat(h, -BOUNCE * v))
    return Phases("bouncing ball", phases, (impact, impact), total=TOTAL)
