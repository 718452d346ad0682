"""Algae by day, and methane from them by day and night: a periodic bioreactor."""

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint, Guess, Model


def bioreactor() -> OCP:
    r"""Feed a digester from a pond of algae so that a day, repeated for ever, gives most methane.

    Algae y, which grow in the light, substrate s and bacteria b, ten units of time a day:

    .. math::

        \max \int_0^{10} \frac{\mu b}{3} dt, \quad
        \dot y = \frac{\ell y}{1 + y} - (0.005 + u) y, \; \dot s = -\mu b + u (y - s), \;
        \dot b = (\mu - u) b

    with mu = 0.1 s/(s + 0.05), light l = max(0, sin(pi t/5))^2, 0 <= u <= 1, y(0), b(0) >= 1,
    s >= 0, and an end that is the start, which is free.

    Optimum: 0.61413. Problem: [Bonnans et al. 2017], after [Bayen, Mairet, Martinon & Sebbah 2015].
    """
    y, s, b, u, t = (ca.SX.sym(name) for name in ("algae", "substrate", "bacteria", "u", "t"))
    light = ca.fmax(0.0, ca.sin(np.pi * t / 5.0)) ** 2
    eaten = 0.1 * s / (s + 0.05)
    f = ca.vertcat(
        light * y / (1.0 + y) - (0.005 + u) * y,
        -eaten * b + u * (y - s),
        (eaten - u) * b,
    )
    model = Model(name="pond and digester", x=ca.vertcat(y, s, b), u=u, f=f, t=t)
    return OCP(
        name="bioreactor",
        model=model,
        x0=[2.0, 1.0, 3.0],
        horizon=10.0,
        running_cost=-eaten * b / 3.0,
        control_bounds=Box(0.0, 1.0),
        state_bounds=Box(lower=[0.0, 0.0, 1e-3]),
        free_start=("algae", "substrate", "bacteria"),
        start_bounds=Box([1.0, 0.0, 1.0], [20.0, 20.0, 20.0]),
        constraints=(Constraint("day after day", model.x - model.start, 0.0, 0.0, at="terminal"),),
        smoothness=1,
        guess=Guess(u=[0.1]),
    )
