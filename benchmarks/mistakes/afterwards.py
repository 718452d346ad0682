"""Mistakes written when the checks were finished, and judged once: all held out."""

import casadi as ca
import numpy as np

from benchmarks.mistakes import problems as of
from benchmarks.mistakes.mistake import Mistake
from ocp import Box, Constraint, FreeTime
from solvers.internal import Cause

AFTERWARDS = (
    Mistake(
        "absolute value as the root of a square",
        Cause.NOT_FINITE,
        "torque",
        lambda: of.pendulum(running_cost=lambda s: ca.sqrt(s.torque**2)),
        held_out=True,
    ),
    Mistake(
        "engine without an upper bound",
        Cause.LINEAR_COST,
        "thrust",
        lambda: of.lander(
            running_cost=lambda s: s.thrust, terminal_cost=0.0, control_bounds=Box(lower=0.0)
        ),
        held_out=True,
    ),
    Mistake(
        "rest at a place that is forbidden",
        Cause.CONTRADICTION,
        "place",
        lambda: of.regulator(
            constraints=of.ends({"place": 0.0}),
            state_bounds=Box([0.5, -np.inf], [np.inf, np.inf]),
        ),
        held_out=True,
    ),
    Mistake(
        "warmer than allowed at the end",
        Cause.CONTRADICTION,
        "warmth",
        lambda: of.room(constraints=of.ends({"warmth": 30.0})),
        held_out=True,
    ),
    Mistake(
        "millivolts instead of volts",
        Cause.OUT_OF_REACH,
        "voltage",
        lambda: of.servo(
            parameters=(),
            symbols=(),
            running_cost=lambda s: s.voltage**2,
            control_bounds=Box(-0.05, 0.05),
            constraints=of.ends({"spot": 1.0}),
        ),
        held_out=True,
    ),
    Mistake(
        "target behind the wall",
        Cause.CONTRADICTION,
        "wall",
        lambda: of.drone(
            constraints=lambda s: (*of.ends({"px": 2.0})(s), Constraint("wall", s.px, upper=1.0))
        ),
        held_out=True,
    ),
    Mistake(
        "effort left out",
        Cause.FREE_CONTROL,
        "u",
        lambda: of.oscillator(running_cost=lambda s: (s.x1**2 + s.x2**2) / 2),
        held_out=True,
    ),
    Mistake(
        "speed limit too low for the time",
        Cause.OUT_OF_REACH,
        "speed",
        lambda: of.car(
            state_bounds=Box([-np.inf, -np.inf, -np.inf, 0.0], [np.inf, np.inf, np.inf, 1.0])
        ),
        held_out=True,
    ),
    Mistake(
        "one rate as the next state",
        Cause.TIME_KIND,
        "level",
        lambda: of.tank(dt=0.1, horizon=50),
        held_out=True,
    ),
    Mistake(
        "terminal miss rewarded",
        Cause.WRONG_SIGN,
        "position",
        lambda: of.cart(terminal_cost=lambda s: -((s.position - 1) ** 2), constraints=()),
        held_out=True,
    ),
    Mistake(
        "gravity in millimetres",
        Cause.CONFLICT,
        "thrust",
        lambda: of.lander(
            f=lambda s: (s.speed, s.thrust / s.mass - 1620.0, -s.thrust / 3000.0),
        ),
        held_out=True,
    ),
    Mistake(
        "effort only",
        Cause.NO_GOAL,
        "push",
        lambda: of.cartpole(running_cost=lambda s: s.push**2, terminal_cost=0.0),
        held_out=True,
    ),
    Mistake(
        "upper bound of the time below the shortest",
        Cause.OUT_OF_REACH,
        "end position",
        lambda: of.fastest(horizon=FreeTime(guess=0.3, lower=0.1, upper=0.5)),
        held_out=True,
    ),
)
