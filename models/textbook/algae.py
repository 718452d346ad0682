"""Algae by day and bacteria by night: a day that repeats itself and gives the most gas."""

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint, Guess, Model

# Loss and yields of the two, half saturation and rate of the bacteria; length of the day.
LOSS, HALF, RATE, DAY = 0.005, 0.05, 0.1, 10.0
# Of the gas, what the bacteria grow: 1/(beta + c).
SHARE = 1.0 / 3.0


def periodic_algae() -> OCP:
    r"""Run a pond and a digester through one day, so that the next can begin in the same way.

    .. math::

        \max \int_0^{10} \frac{\nu(s) b}{3} \, dt, \quad
        \dot y = \frac{\mu(t) y}{1 + y} - (0.005 + u) y, \;
        \dot s = -\nu(s) b + u (y - s), \; \dot b = (\nu(s) - u) b, \quad 0 \le u \le 1

    with the light μ = max(0, sin(2π t/10))², ν = 0.1 s/(0.05 + s), and (y, s, b)(10) =
    (y, s, b)(0). Algae y in a pond feed, by the flow u, the bacteria b on what is dissolved, s. At
    the start y, b >= 1; where the day starts is free, and the ends are coupled (``start(x)``).
    Optimum: 0.614134 (the cost is its negative). Problem: [Bonnans et al. 2017], after
    [Bayen, Mairet, Martinon & Sebbah 2015].
    """
    y, s, b, u, t = (ca.SX.sym(name) for name in ("algae", "dissolved", "bacteria", "flow", "t"))
    # Squared after the cut: at dawn and dusk the first derivative is continuous, the second is not.
    light = ca.fmax(0.0, ca.sin(2.0 * np.pi * t / DAY)) ** 2
    growth = RATE * s / (HALF + s)
    model = Model(
        name="pond",
        x=ca.vertcat(y, s, b),
        u=u,
        f=ca.vertcat(
            light * y / (1.0 + y) - (LOSS + u) * y, -growth * b + u * (y - s), (growth - u) * b
        ),
        t=t,
    )
    return OCP(
        name="algae, periodic",
        model=model,
        x0=[1.5, 0.5, 2.0],
        free_start=model.x_names,
        start_bounds=Box([1.0, 0.0, 1.0], np.inf),
        state_bounds=Box([0.0, 0.0, 1e-3], np.inf),
        horizon=DAY,
        running_cost=-SHARE * growth * b,
        control_bounds=Box(0.0, 1.0),
        smoothness=1,
        constraints=(Constraint("period", model.x - model.start, 0.0, 0.0, at="terminal"),),
        guess=Guess(x=[[1.5, 0.5, 2.0], [2.5, 0.5, 2.0], [1.5, 0.5, 2.0]], u=[0.1]),
    )
