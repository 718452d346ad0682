"""A car against the drag of the air: 1000 m from stand to stand, as one problem and as its arcs."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Box, FreeTime, Guess, Link, Model, Phases

# Mass [kg], drag [N s^2/m^2], largest force [N], distance [km].
MASS, DRAG, FORCE, DISTANCE = 500.0, 2.0, 2500.0, 1.0
_METRES = 1e3  # of a km
# A first guess of how long the drive takes, and each half of it [s].
_GUESS = 40.0


def _rates(position: ca.SX, speed: ca.SX, force: ca.SX | float) -> ca.SX:
    return ca.vertcat(speed / _METRES, (force - DRAG * speed**2) / MASS)


def car_minimum_time() -> OCP:
    r"""Drive 1000 m from stand to stand as fast as possible.

    .. math::

        \min T, \quad \dot p = v/1000, \; \dot v = (F - 2 v^2)/500, \; |F| \le 2500, \quad
        (p, v): (0, 0) \to (1, 0)

    The position in km, the speed in m/s, the force in N. Optimum: 36.2873341398 s, full force, then
    full brake. With V = √(2500/2) and k = 500/√(2·2500), the car has the speed sV after k artanh s,
    and stands k arctan s later. On the way it covers (500/4) ln((1 + s²)/(1 - s²)) = 1000 m, so
    that s² = tanh 4, and T = k (artanh s + arctan s). Problem: an example of rockit,
    [Gillis et al. 2020].
    """
    position, speed, force = (ca.SX.sym(name) for name in ("position", "speed", "force"))
    x = ca.vertcat(position, speed)
    return OCP(
        name="car, 1000 m",
        model=Model(
            name="car",
            x=x,
            u=force,
            f=_rates(position, speed, force),
            x_units=("km", "m/s"),
            u_units=("N",),
        ),
        x0=[0.0, 0.0],
        horizon=FreeTime(guess=_GUESS, lower=5.0, upper=200.0),
        running_cost=1.0,
        control_bounds=Box(-FORCE, FORCE),
        constraints=ends_at(x, [DISTANCE, 0.0]),
        guess=Guess(x=_there(), u=[[FORCE], [-FORCE]], duration=_GUESS),
    )


def _there() -> np.ndarray:
    """A drive of constant speed, but for its ends."""
    middle = [DISTANCE / 2, _METRES * DISTANCE / _GUESS]
    return np.array([[0.0, 0.0], middle, [DISTANCE, 0.0]])


def car_in_arcs() -> Phases:
    r"""The same drive, its arcs as phases: their durations are all that is unknown.

    .. math::

        \min T_1 + T_2, \quad \dot p = v/1000, \; \dot v = (\pm 2500 - 2 v^2)/500, \quad
        (p, v): (0, 0) \to (1, 0)

    Phase 1 has the full force, phase 2 the full brake; neither has a control. Optimum: that of
    ``car_minimum_time``, 36.2873341398 s; the two ends decide both durations. A direct method
    meets the switch exactly, because it is a node.
    """
    position, speed = ca.SX.sym("position"), ca.SX.sym("speed")
    x, (start, middle, end) = ca.vertcat(position, speed), _there()
    phases = [
        OCP(
            name=name,
            model=Model(
                name="car",
                x=x,
                u=ca.SX(0, 1),
                f=_rates(position, speed, force),
                x_units=("km", "m/s"),
            ),
            x0=path[0],
            horizon=FreeTime(guess=_GUESS / 2, lower=1.0, upper=100.0),
            running_cost=1.0,
            constraints=ends,
            guess=Guess(x=path),
        )
        for name, force, path, ends in (
            ("full force", FORCE, [start, middle], ()),
            ("full brake", -FORCE, [middle, end], ends_at(x, end)),
        )
    ]
    return Phases("car in arcs", tuple(phases), (Link(),))
