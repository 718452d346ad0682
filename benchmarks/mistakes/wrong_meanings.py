"""Mistakes in integrals, soft constraints, instants, peaks, rates, delays, tables, equations."""

import casadi as ca
import numpy as np

from benchmarks.mistakes import problems as of
from benchmarks.mistakes.mistake import Mistake
from ocp import Box, Constraint, Delay, Peak, Rate, Soft, Table
from solvers.internal import Cause

CART_ENDS = of.ends({"position": 1.0, "velocity": 0.0})
REST = of.ends({"place": 0.0, "pace": 0.0})


def _curve(s, beyond):
    volts = np.linspace(0.0, 10.0, 30)
    torque = Table(volts, 5.0 * np.tanh(volts / 5), beyond=beyond, name="torque")
    return torque(s.force)


MEANINGS = (
    Mistake(
        "budget below what the way takes",
        Cause.OUT_OF_REACH,
        "budget",
        lambda: of.cart(
            constraints=lambda s: (
                *CART_ENDS(s),
                Constraint("budget", s.force**2, upper=0.5, at="integral"),
            )
        ),
    ),
    Mistake(
        "negative budget of a square",
        Cause.CONFLICT,
        "budget",
        lambda: of.cart(
            running_cost=lambda s: (s.position - 1) ** 2,
            constraints=lambda s: (Constraint("budget", s.force**2, upper=-1.0, at="integral"),),
        ),
        held_out=True,
    ),
    Mistake(
        "litres where metres are meant",
        Cause.OUT_OF_REACH,
        "supply",
        lambda: of.tank(
            constraints=lambda s: (Constraint("supply", s.inflow, 200.0, 300.0, at="integral"),)
        ),
        held_out=True,
    ),
    Mistake(
        "integral of what nothing moves",
        Cause.UNREACHABLE,
        "dose",
        lambda: of.cart(
            constraints=lambda s: (
                *CART_ENDS(s),
                Constraint("dose", ca.sin(s.t), 2.0, 2.0, at="integral"),
            )
        ),
    ),
    Mistake(
        "budget without a number",
        Cause.VACUOUS,
        "budget",
        lambda: of.cart(
            constraints=lambda s: (*CART_ENDS(s), Constraint("budget", s.force**2, at="integral"))
        ),
    ),
    Mistake(
        "soft end at a price of nothing",
        Cause.CHEAP_SOFT,
        "arrive",
        lambda: of.cart(
            constraints=lambda s: (
                Constraint(
                    "arrive", s.position, 1.0, 1.0, at="terminal", soft=Soft(quadratic=1e-7)
                ),
            )
        ),
    ),
    Mistake(
        "speed limit that costs nothing to break",
        Cause.CHEAP_SOFT,
        "slow",
        lambda: of.cart(
            constraints=lambda s: (
                *CART_ENDS(s),
                Constraint("slow", s.velocity, -1.0, 0.6, soft=Soft(linear=1e-6)),
            )
        ),
        held_out=True,
    ),
    Mistake(
        "price of a soft constraint beyond all digits",
        Cause.BAD_SCALING,
        "slow",
        lambda: of.cart(
            constraints=lambda s: (
                *CART_ENDS(s),
                Constraint("slow", s.velocity, -1.0, 0.6, soft=Soft(quadratic=1e14)),
            )
        ),
    ),
    Mistake(
        "soft constraint without a bound",
        Cause.VACUOUS,
        "slow",
        lambda: of.cart(
            constraints=lambda s: (
                *CART_ENDS(s),
                Constraint("slow", s.velocity, soft=Soft(linear=10.0)),
            )
        ),
        held_out=True,
    ),
    Mistake(
        "gate behind the wall",
        Cause.CONTRADICTION,
        "gate",
        lambda: of.cart(
            constraints=lambda s: (
                *CART_ENDS(s),
                Constraint("gate", s.position, 2.0, 2.0, at=1.0),
                Constraint("wall", s.position, upper=1.5),
            )
        ),
    ),
    Mistake(
        "gate a moment after the start",
        Cause.OUT_OF_REACH,
        "gate",
        lambda: of.cart(
            constraints=lambda s: (
                *CART_ENDS(s),
                Constraint("gate", s.position, 0.5, 0.5, at=0.05),
            )
        ),
    ),
    Mistake(
        "two gates at one instant",
        Cause.CONTRADICTION,
        "second",
        lambda: of.car(
            constraints=lambda s: (
                *of.ends({"x": 10.0, "y": 0.0, "speed": 0.0})(s),
                Constraint("first", s.x, 3.0, 3.0, at=2.0),
                Constraint("second", s.x, 5.0, 5.0, at=[2.0, 4.0]),
            )
        ),
        held_out=True,
    ),
    Mistake(
        "gate beyond the bounds of the state",
        Cause.CONTRADICTION,
        "gate",
        lambda: of.room(constraints=lambda s: (Constraint("gate", s.warmth, lower=30.0, at=4.0),)),
        held_out=True,
    ),
    Mistake(
        "gate in degrees",
        Cause.DEGREES,
        "angle",
        lambda: of.pendulum(
            constraints=lambda s: (Constraint("gate", s.angle, 45.0, 45.0, at=1.0),)
        ),
        held_out=True,
    ),
    Mistake(
        "peak of what nothing moves",
        Cause.NO_INFLUENCE,
        "wave",
        lambda: of.cart(peaks=lambda s: (Peak("wave", ca.sin(s.t)),)),
    ),
    Mistake(
        "peak of the load and no task",
        Cause.NO_GOAL,
        "force",
        lambda: of.cart(
            running_cost=0.0,
            constraints=(),
            peaks=lambda s: (Peak("load", ca.fabs(s.force)),),
        ),
        held_out=True,
    ),
    Mistake(
        "peak of the speed, force free of charge",
        Cause.FREE_CONTROL,
        "force",
        lambda: of.cart(
            running_cost=0.0,
            control_bounds=Box(),
            peaks=lambda s: (Peak("speed", s.velocity),),
        ),
    ),
    Mistake(
        "rate of the force a hundred times too low",
        Cause.OUT_OF_REACH,
        "rate of force",
        lambda: of.cart(rates=lambda s: (Rate(s.force, -0.1, 0.1),), last_input=[0.0]),
    ),
    Mistake(
        "rate per second in steps",
        Cause.OUT_OF_REACH,
        "rate of u",
        lambda: of.regulator(
            rates=lambda s: (Rate(s.u, -0.002, 0.002),), last_input=[0.0], constraints=REST
        ),
        held_out=True,
    ),
    Mistake(
        "a grip that the last input has not",
        Cause.START_VIOLATES,
        "grip",
        lambda: of.cart(
            rates=lambda s: (Rate(s.force, -100.0, 100.0),),
            last_input=[0.0],
            constraints=lambda s: (
                *of.ends({"position": 1.0})(s),
                Constraint("grip", s.force, lower=1.0),
            ),
        ),
    ),
    Mistake(
        "rate of what costs nothing",
        Cause.NO_GOAL,
        "force",
        lambda: of.cart(
            running_cost=0.0, rates=lambda s: (Rate(s.force, weight=1.0),), constraints=()
        ),
        held_out=True,
    ),
    Mistake(
        "delay as long as the horizon",
        Cause.NO_INFLUENCE,
        "u",
        lambda: of.regulator(horizon=20, delays=lambda s: (Delay(s.u, 20),)),
    ),
    Mistake(
        "delay that leaves one step",
        Cause.OUT_OF_REACH,
        "end place",
        lambda: of.regulator(horizon=12, delays=lambda s: (Delay(s.u, 9),), constraints=REST),
        held_out=True,
    ),
    Mistake(
        "table left on the way",
        Cause.NOT_FINITE,
        "position",
        lambda: of.cart(
            f=lambda s: (s.velocity, s.force / 2 - _slope(s)),
            x0=[0.0, 3.0],
        ),
    ),
    Mistake(
        "table of volts asked in millivolts",
        Cause.UNREACHABLE,
        "end position",
        lambda: of.cart(
            f=lambda s: (s.velocity, _curve(s, "clamp") / 2),
            control_bounds=Box(1000.0, 10000.0),
            smoothness=0,
        ),
    ),
    Mistake(
        "table with kinks declared smooth",
        Cause.KINK,
        "position",
        lambda: of.cart(
            f=lambda s: (s.velocity, s.force / 2 - ca.fabs(s.position - 0.5)),
        ),
        held_out=True,
    ),
    Mistake(
        "power that the motor has not",
        Cause.CONTRADICTION,
        "power",
        lambda: of.cart(
            z=("power",),
            f=lambda s: (s.velocity, s.force / 2),
            algebraic=lambda s: (s.power - s.force * 2.0,),
            constraints=lambda s: (*CART_ENDS(s), Constraint("power", s.power, lower=25.0)),
        ),
    ),
    Mistake(
        "algebraic variable that nobody uses",
        Cause.UNUSED,
        "drag",
        lambda: of.cart(
            z=("drag",),
            algebraic=lambda s: (s.drag - 0.1 * s.velocity,),
        ),
        held_out=True,
    ),
)


def _slope(s):
    places = np.linspace(-0.2, 1.2, 30)
    return Table(places, np.sin(places), beyond="refuse", name="slope")(s.position)
