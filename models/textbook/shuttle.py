"""The space shuttle on its way down: as far to the side as it comes."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Model

# Mass [slug], radius of the Earth [ft], gravity [ft^3/s^2], wing [ft^2].
MASS, EARTH, GRAVITY, WING = 203000.0 / 32.174, 20902900.0, 0.14076539e17, 2690.0
# Density of the air at the ground [slug/ft^3] and the height in which it falls to 1/e [ft].
DENSITY, SCALE = 0.002378, 23800.0
# Coefficients of lift and drag, the angle of attack in degrees.
LIFT, DRAG = (-0.20704, 0.029244), (0.07854, -0.61592e-2, 0.621408e-3)
# Units of height [ft] and speed [ft/s], and in these where it starts and where it ends.
FAR, SWIFT = 1e5, 1e4
HIGH, LOW, FAST, SLOW = 2.6, 0.8, 2.56, 0.25
_GUESS = 2000.0


def shuttle_reentry() -> OCP:
    r"""Enter the atmosphere over the equator and end as far north as possible.

    .. math::

        \max \theta(T), \quad \dot h = v \sin\gamma, \;
        \dot\theta = \frac{v}{r} \cos\gamma \cos\psi, \;
        \dot v = -\frac{D}{m} - g \sin\gamma, \;
        \dot\gamma = \frac{L \cos\beta}{m v} + \cos\gamma \left(\frac{v}{r} - \frac{g}{v}\right),
        \; \dot\psi = \frac{L \sin\beta}{m v \cos\gamma}
            + \frac{v}{r} \cos\gamma \sin\psi \tan\theta

    with the height h [100000 ft], the latitude θ, the speed v [10000 ft/s], the angle γ of the path
    and the heading ψ; the controls are the angle of attack α in the lift L and the drag D, and the
    angle of bank β, -89° <= β <= 1°. From 260000 ft, 25600 ft/s, γ = -1°, ψ = 90° (east) to 80000
    ft, 2500 ft/s, γ = -5°. The longitude does not act on the rest and is left out, and so is the
    limit of the heating. Optimum: 34.14118° after 2008.6 s (the cost is minus the latitude in rad).
    Problem: [Betts 2010, section 6.1].
    """
    names = ("height", "latitude", "speed", "path", "heading")
    height, theta, speed, gamma, psi = (ca.SX.sym(name) for name in names)
    h, v = FAR * height, SWIFT * speed
    attack, bank = ca.SX.sym("attack"), ca.SX.sym("bank")
    r, alpha = EARTH + h, attack * 180.0 / np.pi
    g, pressure = GRAVITY / r**2, 0.5 * DENSITY * ca.exp(-h / SCALE) * WING * v**2 / MASS
    lift = (LIFT[0] + LIFT[1] * alpha) * pressure
    drag = (DRAG[0] + DRAG[1] * alpha + DRAG[2] * alpha**2) * pressure
    rate = ca.vertcat(
        v * ca.sin(gamma) / FAR,
        v / r * ca.cos(gamma) * ca.cos(psi),
        -(drag + g * ca.sin(gamma)) / SWIFT,
        lift / v * ca.cos(bank) + ca.cos(gamma) * (v / r - g / v),
        lift * ca.sin(bank) / (v * ca.cos(gamma))
        + v / r * ca.cos(gamma) * ca.sin(psi) * ca.tan(theta),
    )
    start = [HIGH, 0.0, FAST, np.radians(-1.0), np.radians(90.0)]
    end = [LOW, np.radians(30.0), SLOW, np.radians(-5.0), np.radians(10.0)]
    return OCP(
        name="shuttle, re-entry",
        model=Model(
            name="shuttle",
            x=ca.vertcat(height, theta, speed, gamma, psi),
            u=ca.vertcat(attack, bank),
            f=rate,
            x_units=("100000 ft", "rad", "10000 ft/s", "rad", "rad"),
            u_units=("rad", "rad"),
        ),
        x0=start,
        horizon=FreeTime(guess=_GUESS, lower=500.0, upper=4000.0),
        terminal_cost=-theta,
        control_bounds=Box(np.radians([-90.0, -89.0]), np.radians([90.0, 1.0])),
        constraints=ends_at(ca.vertcat(height, speed, gamma), [LOW, SLOW, np.radians(-5.0)]),
        guess=Guess(x=[start, end], u=np.radians([17.0, -40.0]), duration=_GUESS),
    )
