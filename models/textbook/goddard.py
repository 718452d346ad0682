"""Goddard's rocket: as high as the fuel lasts, with and without a limit of speed."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Model
from ocp.internal import check_positive

DRAG, DECAY, THRUST, EXHAUST = 310.0, 500.0, 3.5, 0.5


def goddard(*, fastest: float = np.inf) -> OCP:
    r"""Rise as high as possible until the fuel is spent.

    .. math::

        \min -r(T), \quad \dot r = v, \;
        \dot v = \frac{u - 310 v^2 e^{-500 (r - 1)}}{m} - \frac{1}{r^2}, \; \dot m = -2u, \;
        0 \le u \le 3.5, \quad (r, v, m): (1, 0, 1) \to (\cdot, \cdot, 0.6)

    In units of the planet's radius, its gravity and the mass at the start. Optimum: without a
    limit -1.0128369 (full thrust, a singular arc, none); with v <= 0.1 -1.0125763 (full thrust,
    singular, along the limit, none). Problem: [Bryson & Ho 1975]; [Dolan, More & Munson 2004].

    Args:
        fastest: limit of the speed; inf: none.
    """
    limit = check_positive(fastest, "Goddard: fastest", finite=False)
    r, v, m, thrust = (ca.SX.sym(name) for name in ("radius", "speed", "mass", "thrust"))
    drag = DRAG * v**2 * ca.exp(-DECAY * (r - 1.0))
    rate = ca.vertcat(v, (thrust - drag) / m - 1.0 / r**2, -thrust / EXHAUST)
    climb = np.linspace([1.0, 0.05, 1.0], [1.01, 0.05, 0.6], 11)
    return OCP(
        name="Goddard" if np.isinf(limit) else f"Goddard, v <= {limit:g}",
        model=Model(name="rocket", x=ca.vertcat(r, v, m), u=thrust, f=rate),
        x0=[1.0, 0.0, 1.0],
        horizon=FreeTime(guess=0.2, lower=0.02, upper=1.0),
        terminal_cost=-r,
        control_bounds=Box(0.0, THRUST),
        state_bounds=Box([1.0, 0.0, 0.6], [np.inf, limit, 1.0]),
        constraints=ends_at(m, 0.6),
        guess=Guess(x=climb, u=[THRUST / 3.0], duration=0.2),
    )
