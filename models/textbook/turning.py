"""A vehicle that cannot turn at once: the way home, and a target that flies on."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Model
from ocp.internal import check_positive

# Speed of the interceptor over that of its target; its largest turn [rad] per unit of time.
FASTER, LOAD = 2.0, 1.0
# Of the target at the start, and how fast it goes: (x, y).
TARGET, COURSE = np.array([3.0, 2.0]), np.array([1.0, 0.0])


def _vehicle(speed: float) -> Model:
    x, y, heading, turn = (ca.SX.sym(name) for name in ("x", "y", "heading", "turn"))
    return Model(
        name="vehicle",
        x=ca.vertcat(x, y, heading),
        u=turn,
        f=ca.vertcat(speed * ca.cos(heading), speed * ca.sin(heading), turn),
        t=ca.SX.sym("t"),
        x_units=("m", "m", "rad"),
        u_units=("rad/s",),
    )


def shortest_turn() -> OCP:
    r"""Come home on the shortest way that no turn is too narrow for.

    .. math::

        \min T, \quad \dot x = \cos h, \; \dot y = \sin h, \; \dot h = u, \; |u| \le 2, \quad
        (x, y, h): (4, 0, \pi/2) \to (0, 0, \cdot)

    Optimum: √12 + (π - arccos(1/7))/2 = 4.32117356. An arc of radius 1/2 to the left about
    (3.5, 0), until a line from there touches the end: the line is √(3.5² - 0.5²) long, and the
    angle at the centre between the end and the point of contact is arccos(0.5/3.5). To the right
    it is a local optimum, 6.0185. Problem: [Dubins 1957].
    """
    model = _vehicle(1.0)
    return OCP(
        name="shortest turn",
        model=model,
        x0=[4.0, 0.0, np.pi / 2],
        horizon=FreeTime(guess=4.5, lower=1.0, upper=20.0),
        running_cost=1.0,
        control_bounds=Box(-2.0, 2.0),
        constraints=ends_at(model.x[:2], [0.0, 0.0]),
        guess=Guess(
            x=[[4.0, 0.0, np.pi / 2], [3.5, 0.5, np.pi], [0.0, 0.0, np.pi]], u=[0.5], duration=4.5
        ),
    )


def interceptor(*, load: float = LOAD) -> OCP:
    r"""Meet a target that flies on, as early as a limit of the load allows.

    .. math::

        \min T, \quad \dot x = 2 \cos h, \; \dot y = 2 \sin h, \; \dot h = u, \; |u| \le 1, \quad
        (x, y, h)(0) = (0, 0, \pi), \; (x, y)(T) = (3 + T, 2)

    The load, speed times rate of turn, is limited, and the interceptor heads away from the target.
    Optimum: 9.44425075. It turns with the largest load to the right, for a time τ, and
    then flies straight: of all ways to a point this is the shortest, and the earliest meeting is on
    it. With r = 2/u_max and the angle φ = u_max τ the turn ends at (-r sin φ, r (1 - cos φ)) with
    the heading π - φ, and

    .. math::

        -r \sin φ - 2 (T - τ) \cos φ = 3 + T, \quad r (1 - \cos φ) + 2 (T - τ) \sin φ = 2

    are two equations for T and τ. To the left it is a local optimum. Problem: after
    [Bryson & Ho 1975], sections 2.7 and 3.9, and [Dubins 1957].

    Args:
        load: largest rate of turn, > 0.
    """
    load = check_positive(load, "interceptor: load")
    model = _vehicle(FASTER)
    meeting = model.x[:2] - ca.DM(TARGET) - model.t * ca.DM(COURSE)
    return OCP(
        name="interceptor",
        model=model,
        x0=[0.0, 0.0, np.pi],
        horizon=FreeTime(guess=5.0, lower=1.0, upper=20.0),
        running_cost=1.0,
        control_bounds=Box(-load, load),
        constraints=ends_at(meeting, [0.0, 0.0]),
        guess=Guess(
            x=[[0.0, 0.0, np.pi], [0.0, 3.0, 0.5], [8.0, 2.0, 0.0]], u=[-0.5], duration=5.0
        ),
    )
