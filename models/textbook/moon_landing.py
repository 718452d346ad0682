"""A soft landing on the moon, with as much fuel left as possible."""

import casadi as ca

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Model

# In units of the moon's gravity, the height and the mass at the start.
THRUST, EXHAUST = 1.227, 2.349
HEIGHT, SPEED = 1.0, -0.783


def moon_landing() -> OCP:
    r"""Land softly with as much mass as possible.

    .. math::

        \max m(T), \quad \dot h = v, \; \dot v = F/m - 1, \; \dot m = -F/2.349, \;
        0 \le F \le 1.227, \quad (h, v, m): (1, -0.783, 1) \to (0, 0, \cdot)

    Optimum: 0.3953544 (the cost is its negative): fall freely for a time a, then brake with full
    thrust for b. With α = 1.227/2.349 and the mass w = 1 - α b at the end,

    .. math::

        v(T) = -0.783 - a - b - 2.349 \ln w = 0, \quad
        h(T) = 1 - 0.783 a - \tfrac{a^2}{2} - (0.783 + a) b - \tfrac{b^2}{2}
            + 2.349 \left(b + \frac{w \ln w}{\alpha}\right) = 0

    give a and b. Problem: [Meditch 1964]; data of the example of dymos.
    """
    h, v, m, thrust = (ca.SX.sym(name) for name in ("height", "speed", "mass", "thrust"))
    x = ca.vertcat(h, v, m)
    return OCP(
        name="moon landing",
        model=Model(
            name="lander", x=x, u=thrust, f=ca.vertcat(v, thrust / m - 1.0, -thrust / EXHAUST)
        ),
        x0=[HEIGHT, SPEED, 1.0],
        horizon=FreeTime(guess=1.4, lower=0.2, upper=5.0),
        terminal_cost=-m,
        control_bounds=Box(0.0, THRUST),
        constraints=ends_at(x[:2], [0.0, 0.0]),
        guess=Guess(x=[[HEIGHT, SPEED, 1.0], [0.0, 0.0, 0.4]], u=[THRUST], duration=1.4),
    )
