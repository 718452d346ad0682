"""The shortest time around obstacles."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, Constraint, FreeTime, Guess, Model

# Centres of the discs, the square of their radius, where the way ends.
CENTRES, SQUARE, END = ((0.4, 0.5), (0.8, 1.5)), 0.1, (1.2, 1.6)


def around_discs() -> OCP:
    r"""Drive past two discs with a speed of 1, in the least time.

    .. math::

        \min T, \quad \dot x = \cos u, \; \dot y = \sin u, \quad
        (x - 0.4)^2 + (y - 0.5)^2 \ge 0.1, \; (x - 0.8)^2 + (y - 1.5)^2 \ge 0.1, \quad
        (x, y): (0, 0) \to (1.2, 1.6)

    Optimum: the shortest string, 2.131797: a tangent of the first disc, 0.8 radians around it, and
    its tangent through the end, which passes the second disc at a distance. Between the discs it
    takes 2.137849. Discs and ends: [Becerra 2010], who drives through there within 1 at 2.138.
    """
    place, heading = ca.SX.sym("place", 2), ca.SX.sym("heading")
    rows = tuple(
        Constraint(f"disc {i + 1}", ca.sumsqr(place - ca.DM(centre)), lower=SQUARE)
        for i, centre in enumerate(CENTRES)
    )
    ends = np.array([[0.0, 0.0], [0.65, 0.25], [0.95, 1.0], END])
    return OCP(
        name="around discs",
        model=Model(
            name="point",
            x=place,
            u=heading,
            f=ca.vertcat(ca.cos(heading), ca.sin(heading)),
        ),
        x0=[0.0, 0.0],
        horizon=FreeTime(2.2, lower=0.1),
        running_cost=1.0,
        control_bounds=Box(-np.pi, np.pi),  # a heading is one up to whole turns
        constraints=(*ends_at(place, END), *rows),
        guess=Guess(x=ends, u=[[0.4], [0.7], [1.2], [1.2]]),
    )
