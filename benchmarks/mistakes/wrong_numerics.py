"""Mistakes in numbers, units and time: what a solver meets as NaN, or does not meet at all."""

import casadi as ca
import numpy as np

from benchmarks.mistakes import problems as of
from benchmarks.mistakes.mistake import Mistake
from ocp import Box, Signal
from solvers.internal import Cause

_HALF = np.linspace(1.0, 0.0, 21)

NUMERICS = (
    Mistake(
        "empty tank, root at zero",
        Cause.NOT_FINITE,
        "level",
        lambda: of.tank(x0=[0.0], state_bounds=Box(0.0, 10.0)),
    ),
    Mistake(
        "distance at the origin (OptimalControl.jl issue 369)",
        Cause.NOT_FINITE,
        "x",
        lambda: of.car(
            running_cost=lambda s: s.push**2 + s.turn**2 + ca.sqrt(s.x**2 + s.y**2), guess=None
        ),
    ),
    Mistake(
        "logarithm of a level that falls",
        Cause.NOT_FINITE,
        "level",
        lambda: of.tank(
            f=lambda s: (s.inflow - 0.5,),
            state_bounds=Box(),
            running_cost=lambda s: ca.log(s.level) ** 2 + 0.1 * s.inflow**2,
        ),
    ),
    Mistake(
        "division by the time that is left",
        Cause.NOT_FINITE,
        "t",
        lambda: of.cart(running_cost=lambda s: s.force**2 / (2.0 - s.t)),
    ),
    Mistake(
        "drag as a root of the speed, at rest (do-mpc issue 26)",
        Cause.NOT_FINITE,
        "speed",
        lambda: of.car(
            f=lambda s: (
                s.speed * ca.cos(s.heading),
                s.speed * ca.sin(s.heading),
                s.turn,
                s.push - 0.1 * ca.sqrt(s.speed),
            ),
            guess=None,
        ),
    ),
    Mistake(
        "arc cosine of one",
        Cause.NOT_FINITE,
        "angle",
        lambda: of.pendulum(
            terminal_cost=lambda s: 10 * (s.angle - 1.5) ** 2,
            running_cost=lambda s: s.torque**2 + ca.acos(ca.cos(s.angle)),
        ),
        held_out=True,
    ),
    Mistake(
        "division by a signal that ends at zero",
        Cause.NOT_FINITE,
        "wanted",
        lambda: of.servo(
            running_cost=lambda s: (s.spot / s.wanted - 1) ** 2 + 0.01 * s.voltage**2,
            parameters=lambda s: (Signal("reference", s.wanted, _HALF, hold="linear"),),
        ),
        held_out=True,
    ),
    Mistake(
        "power of a negative number",
        Cause.NOT_FINITE,
        "x1",
        lambda: of.oscillator(
            running_cost=lambda s: (s.x1**1.5 + s.x2**2 + s.u**2) / 2, horizon=6.0
        ),
        held_out=True,
    ),
    Mistake(
        "ninety for a right angle",
        Cause.DEGREES,
        "angle",
        lambda: of.pendulum(constraints=of.ends({"angle": 90.0, "rate": 0.0}), terminal_cost=0.0),
    ),
    Mistake(
        "joints bounded by 180",
        Cause.DEGREES,
        "q1",
        lambda: of.arm(state_bounds=Box([-180.0, -150.0], [180.0, 150.0])),
    ),
    Mistake(
        "wanted angle in the cost",
        Cause.DEGREES,
        "angle",
        lambda: of.pendulum(
            terminal_cost=lambda s: 10 * ((s.angle - 180) ** 2 + s.rate**2), units=False
        ),
    ),
    Mistake(
        "heading of 45 at the start",
        Cause.DEGREES,
        "heading",
        lambda: of.car(x0=[0.0, 0.0, 45.0, 0.0], guess=None),
        held_out=True,
    ),
    Mistake(
        "tilt limit of 30",
        Cause.DEGREES,
        "tilt",
        lambda: of.drone(
            state_bounds=Box([-np.inf] * 4 + [-30.0], [np.inf] * 4 + [30.0]),
        ),
        held_out=True,
    ),
    Mistake(
        "rate given as the next state",
        Cause.TIME_KIND,
        "position",
        lambda: of.cart(dt=0.05, horizon=40),
    ),
    Mistake(
        "next state given as the rate",
        Cause.TIME_KIND,
        "angle",
        lambda: of.pendulum(
            f=lambda s: (
                s.angle + 0.05 * s.rate,
                s.rate + 0.05 * (s.torque - ca.sin(s.angle)),
            )
        ),
    ),
    Mistake(
        "oscillator's rate in discrete time",
        Cause.TIME_KIND,
        "x1",
        lambda: of.oscillator(dt=0.1, horizon=40),
        held_out=True,
    ),
    Mistake(
        "sampled regulator without its step",
        Cause.TIME_KIND,
        "place",
        lambda: of.regulator(dt=None, horizon=4.0),
        held_out=True,
    ),
    Mistake(
        "valve of a tenth of a millisecond",
        Cause.COARSE_GRID,
        "valve",
        lambda: of.tank(
            states={"valve": ""},
            f=lambda s: (s.valve - 0.5 * ca.sqrt(s.level), 1e4 * (s.inflow - s.valve)),
            x0=[1.0, 0.0],
            state_bounds=Box([0.1, -np.inf], [10.0, np.inf]),
        ),
    ),
    Mistake(
        "motor with its electric time constant",
        Cause.COARSE_GRID,
        "current",
        lambda: of.servo(
            states={"current": "A"},
            f=lambda s: (s.drift, s.current - s.drift, 5e3 * (s.voltage - s.current)),
            x0=[0.0, 0.0, 0.0],
        ),
    ),
    Mistake(
        "stiff spring",
        Cause.COARSE_GRID,
        "velocity",
        lambda: of.cart(
            states={"strain": "m", "bounce": "m/s"},
            f=lambda s: (
                s.velocity,
                s.force / 2 + 1e4 * (s.strain - s.position),
                s.bounce,
                1e6 * (s.position - s.strain),
            ),
            x0=[0.0, 0.0, 0.0, 0.0],
            constraints=of.ends({"position": 0.1}),
        ),
        held_out=True,
    ),
)
