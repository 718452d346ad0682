"""A hang glider that comes as far as a thermal carries it."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Model

# Mass [kg], gravity [m/s^2], wing [m^2], density of the air [kg/m^3], drag: C0 + C1 lift^2.
MASS, GRAVITY, WING, DENSITY, C0, C1 = 100.0, 9.81, 14.0, 1.13, 0.034, 0.069662
# The thermal: its speed [m/s] and radius [m]; its middle is 2.5 radii away.
UPDRAFT, RADIUS, MIDDLE = 2.5, 100.0, 2.5
LIFT = 1.4
START, END = [0.0, 1000.0, 13.23, -1.288], [900.0, 13.23, -1.288]


def hang_glider() -> OCP:
    r"""Glide as far as possible on 100 m of height, through a thermal.

    .. math::

        \max x(T), \quad \ddot x = -\frac{L w + D \dot x}{m v}, \;
        \ddot y = \frac{L \dot x - D w}{m v} - g, \; 0 \le c \le 1.4, \quad
        (x, y, \dot x, \dot y): (0, 1000, 13.23, -1.288) \to (\cdot, 900, 13.23, -1.288)

    with w = y' - 2.5 (1 - r) exp(-r), r = (x/100 - 2.5)², v² = x'² + w², L = c ρ S v²/2 and
    D = (0.034 + 0.069662 c²) ρ S v²/2. In m, s and kg; the control c is the coefficient of lift.
    Optimum: 1247.98760 m (the cost is its negative): it flies fast towards the thermal, slowly with
    much lift through it. Problem: [Bulirsch et al. 1993]; data: [Dolan, More & Munson 2004].
    """
    x, y, vx, vy, lift = (ca.SX.sym(name) for name in ("x", "y", "x rate", "y rate", "lift"))
    r = (x / RADIUS - MIDDLE) ** 2
    w = vy - UPDRAFT * (1.0 - r) * ca.exp(-r)
    # Lift and drag, over the mass and the speed.
    size = 0.5 * DENSITY * WING * ca.sqrt(vx**2 + w**2) / MASS
    up, back = lift * size, (C0 + C1 * lift**2) * size
    rate = ca.vertcat(vx, vy, -up * w - back * vx, up * vx - back * w - GRAVITY)
    return OCP(
        name="hang glider",
        model=Model(
            name="glider",
            x=ca.vertcat(x, y, vx, vy),
            u=lift,
            f=rate,
            x_units=("m", "m", "m/s", "m/s"),
            x_nominal=[1000.0, 1000.0, 10.0, 1.0],
        ),
        x0=START,
        horizon=FreeTime(guess=100.0, lower=20.0, upper=300.0),
        terminal_cost=-x,
        control_bounds=Box(0.0, LIFT),
        constraints=ends_at(ca.vertcat(y, vx, vy), END),
        guess=Guess(x=np.array([START, [1250.0, *END]]), u=[LIFT / 2], duration=100.0),
    )
