"""Mistakes in what the optimiser chooses once: unknown constants, starts, ends, by data."""

import casadi as ca
import numpy as np

from benchmarks.mistakes import problems as of
from benchmarks.mistakes.mistake import Mistake
from ocp import Box, Constraint, Measurement, Unknown
from solvers.internal import Cause

_TIMES = np.linspace(0.1, 2.0, 20)
# Of a cart that a force of 1 N pushes against a drag of 0.4 kg/s.
_SPEEDS = 2.5 * (1.0 - np.exp(-0.2 * _TIMES))


def _coasting(**given):
    """Find the drag of the cart from its measured speed."""
    sound = {
        "symbols": ("drag",),
        "f": lambda s: (s.velocity, (1.0 - s.drag * s.velocity) / 2 + 0.01 * s.force),
        "constraints": (),
        "unknowns": lambda s: (Unknown("drag", s.drag, 0.1, 0.0, 10.0),),
        "data": lambda s: (Measurement("speed", s.velocity, _TIMES, _SPEEDS, 0.1),),
    }
    return of.cart(**(sound | given))


def coasting_cart():
    """Return the sound problem: the drag is found."""
    return _coasting()


def _geared(**given):
    """Move the cart through a gear that is to be chosen."""
    sound = {
        "symbols": ("gear",),
        "f": lambda s: (s.velocity, s.gear * s.force / 2),
        "terminal_cost": lambda s: s.gear**2,
        "unknowns": lambda s: (Unknown("gear", s.gear, 1.0, 0.1, 3.0),),
    }
    return of.cart(**(sound | given))


def geared_cart():
    """Return the sound problem: a gear is chosen."""
    return _geared()


def _lap(s):
    return Constraint(
        "lap",
        ca.vertcat(s.position - s.start_position, s.velocity - s.start_velocity),
        0.0,
        0.0,
        at="terminal",
    )


def _round(**given):
    """Follow a wave for one period, with the start free."""
    sound = {
        "running_cost": lambda s: (s.position - ca.sin(np.pi * s.t)) ** 2 + 1e-3 * s.force**2,
        "constraints": lambda s: (_lap(s),),
        "free_start": ("position", "velocity"),
        "control_bounds": Box(-50.0, 50.0),
    }
    return of.cart(**(sound | given))


def periodic_cart():
    """Return the sound problem: a periodic motion."""
    return _round()


CONSTANTS = (
    Mistake(
        "gear too weak for the time",
        Cause.OUT_OF_REACH,
        "gear",
        lambda: _geared(unknowns=lambda s: (Unknown("gear", s.gear, 0.05, 0.01, 0.1),)),
    ),
    Mistake(
        "payload rewarded without an upper bound",
        Cause.UNBOUNDED,
        "payload",
        lambda: of.cart(
            symbols=("payload",),
            running_cost=lambda s: s.force**2 - s.payload,
            unknowns=lambda s: (Unknown("payload", s.payload, 1.0, 0.0),),
        ),
    ),
    Mistake(
        "root of a constant that is guessed as zero",
        Cause.NOT_FINITE,
        "gear",
        lambda: _geared(
            f=lambda s: (s.velocity, ca.sqrt(s.gear) * s.force / 2),
            unknowns=lambda s: (Unknown("gear", s.gear, 0.0, 0.0, 3.0),),
        ),
        held_out=True,
    ),
    Mistake(
        "slope of the ramp in degrees",
        Cause.DEGREES,
        "slope",
        lambda: of.cart(
            symbols=("slope",),
            f=lambda s: (s.velocity, s.force / 2 - 9.81 * ca.sin(s.slope)),
            unknowns=lambda s: (Unknown("slope", s.slope, 10.0, 0.0, 45.0),),
        ),
    ),
    Mistake(
        "launch angle of 45",
        Cause.DEGREES,
        "angle of launch",
        lambda: of.cart(
            symbols=("aim",),
            f=lambda s: (s.velocity * ca.cos(s.aim), s.force / 2),
            x0=[0.0, 1.0],
            running_cost=lambda s: s.force**2 + s.aim**2,
            unknowns=lambda s: (Unknown("angle of launch", s.aim, 45.0),),
        ),
        held_out=True,
    ),
    Mistake(
        "two constants of which only the product acts",
        Cause.UNIDENTIFIABLE,
        "gain",
        lambda: _coasting(
            symbols=("drag", "gain"),
            f=lambda s: (s.velocity, (1.0 - s.gain * s.drag * s.velocity) / 2 + 0.01 * s.force),
            unknowns=lambda s: (
                Unknown("drag", s.drag, 0.1, 0.0, 10.0),
                Unknown("gain", s.gain, 1.0, 0.0, 10.0),
            ),
        ),
    ),
    Mistake(
        "two offsets of one sensor",
        Cause.UNIDENTIFIABLE,
        "offset",
        lambda: _coasting(
            symbols=("drag", "offset", "zero"),
            unknowns=lambda s: (
                Unknown("drag", s.drag, 0.1, 0.0, 10.0),
                Unknown("offset", s.offset, 0.0, -1.0, 1.0),
                Unknown("zero", s.zero, 0.0, -1.0, 1.0),
            ),
            data=lambda s: (
                Measurement("speed", s.velocity + s.offset - s.zero, _TIMES, _SPEEDS, 0.1),
            ),
        ),
        held_out=True,
    ),
    Mistake(
        "drag of what nobody measures",
        Cause.UNIDENTIFIABLE,
        "drag",
        lambda: _coasting(
            states={"heat": "J"},
            f=lambda s: (s.velocity, s.force / 2, s.drag * s.velocity**2),
            x0=[0.0, 0.0, 0.0],
        ),
    ),
    Mistake(
        "all measured at the given start",
        Cause.UNIDENTIFIABLE,
        "drag",
        lambda: _coasting(
            data=lambda s: (Measurement("speed", s.velocity, [0.0], [0.0], 0.1),),
        ),
        held_out=True,
    ),
    Mistake(
        "minus 999 for a value that is missing",
        Cause.OUTLIER,
        "speed",
        lambda: _coasting(
            data=lambda s: (
                Measurement("speed", s.velocity, _TIMES, np.where(_TIMES > 1.95, -999, _SPEEDS)),
            )
        ),
    ),
    Mistake(
        "one sample in millimetres",
        Cause.OUTLIER,
        "place",
        lambda: _coasting(
            data=lambda s: (
                Measurement(
                    "place",
                    s.position,
                    _TIMES,
                    0.25 * _TIMES**2 * np.where(np.abs(_TIMES - 1.0) < 0.01, 1e3, 1.0),
                    0.01,
                ),
            )
        ),
        held_out=True,
    ),
    Mistake(
        "speed at the start forgotten to be zero",
        Cause.NO_GOAL,
        "velocity",
        lambda: of.cart(
            free_start=("velocity",),
            constraints=of.ends({"position": 1.0}),
            running_cost=lambda s: s.force**2,
        ),
    ),
    Mistake(
        "nothing but a period",
        Cause.NO_GOAL,
        "force",
        lambda: _round(running_cost=lambda s: s.force**2),
        held_out=True,
    ),
    Mistake(
        "start outside what the ramp allows",
        Cause.CONTRADICTION,
        "ramp",
        lambda: of.cart(
            free_start=("velocity",),
            start_bounds=Box([-np.inf, 2.0], [np.inf, 3.0]),
            constraints=lambda s: (
                *of.ends({"position": 1.0})(s),
                Constraint("ramp", s.velocity, 0.0, 1.0, at="initial"),
            ),
        ),
    ),
    Mistake(
        "start faster than the limit on the way",
        Cause.CONTRADICTION,
        "slow",
        lambda: of.cart(
            free_start=("velocity",),
            start_bounds=Box([-np.inf, 2.0], [np.inf, 3.0]),
            constraints=lambda s: (
                *of.ends({"position": 1.0})(s),
                Constraint("slow", s.velocity, -1.0, 1.0),
            ),
        ),
        held_out=True,
    ),
    Mistake(
        "a period of what only grows",
        Cause.UNREACHABLE,
        "lap",
        lambda: _round(
            states={"clock": "s"},
            f=lambda s: (s.velocity, s.force / 2, 1.0),
            x0=[0.0, 0.0, 0.0],
            constraints=lambda s: (
                Constraint(
                    "lap",
                    ca.vertcat(
                        s.position - s.start_position,
                        s.velocity - s.start_velocity,
                        s.clock - s.start_clock,
                    ),
                    0.0,
                    0.0,
                    at="terminal",
                ),
            ),
        ),
    ),
    Mistake(
        "a period and an end that says otherwise",
        Cause.CONTRADICTION,
        "lap",
        lambda: _round(
            free_start=(),
            constraints=lambda s: (_lap(s), *of.ends({"position": 1.0})(s)),
        ),
        held_out=True,
    ),
    Mistake(
        "a period written twice",
        Cause.DUPLICATE,
        "again",
        lambda: _round(
            constraints=lambda s: (
                _lap(s),
                Constraint("again", s.start_position - s.position, 0.0, 0.0, at="terminal"),
            )
        ),
    ),
)
