"""Turning round before a wall: a state constraint of second order, in closed form."""

import numpy as np

from models.textbook.ends import ends_at
from models.textbook.mass import mass
from ocp import OCP, Box


def _turn_round(name: str, wall: float, weight: float, pushes: Box, behind: float) -> OCP:
    model = mass()
    return OCP(
        name=name,
        model=model,
        x0=[0.0, 1.0],
        horizon=1.0,
        running_cost=weight * model.u**2,
        control_bounds=pushes,
        state_bounds=Box([behind, -np.inf], [wall, np.inf]),
        constraints=ends_at(model.x, [0.0, -1.0]),
    )


def bryson_denham() -> OCP:
    r"""Turn round within 1/9 m, with least energy: a state constraint that gets active.

    .. math::

        \min \int_0^1 u^2/2 \, dt, \quad \ddot x = u, \; x \le l = 1/9, \quad
        (x, \dot x): (0, 1) \to (0, -1)

    Optimum: cost 4 / (9 l) = 4 exactly, with u* = -2/(3l) (1 - t/(3l)) up to t = 3 l = 1/3,
    0 on the boundary, and symmetric [Bryson & Ho 1975, section 3.11].
    """
    return _turn_round("Bryson-Denham", 1.0 / 9.0, 0.5, Box(), -np.inf)


def breakwell() -> OCP:
    r"""Turn round within 0.1 m, with least energy.

    .. math::

        \min \int_0^1 u^2/2 \, dt, \quad \ddot x = u, \; x \le l = 0.1, \quad
        (x, \dot x): (0, 1) \to (0, -1)

    Optimum: 4 / (9 l) = 4.444444. Up to t = 3l the control is -2/(3l) (1 - t/(3l)), so that
    x = l (1 - (1 - t/(3l))³) touches the wall with no speed and no acceleration; the two arcs cost
    (4/(9l²)) (3l) / 3 together [Bryson & Ho 1975, section 3.11].
    """
    return _turn_round("Breakwell", 0.1, 0.5, Box(), -np.inf)


def beam() -> OCP:
    r"""Bend a beam with least energy without touching a wall.

    .. math::

        \min \int_0^1 u^2 \, dt, \quad \ddot x = u, \; 0 \le x \le l = 0.1, \; |u| \le 10, \quad
        (x, \dot x): (0, 1) \to (0, -1)

    Optimum: 8 / (9 l) = 8.888889, twice that of ``breakwell``, whose controls reach 20/3 and
    keep x >= 0: the other bounds do not act. Problem: [Bonnans et al. 2017].
    """
    return _turn_round("beam", 0.1, 1.0, Box(-10.0, 10.0), 0.0)
