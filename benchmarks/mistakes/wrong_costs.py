"""Mistakes in the cost: no minimum, the wrong sign, no goal."""

import casadi as ca

from benchmarks.mistakes import problems as of
from benchmarks.mistakes.mistake import Mistake
from ocp import Box, Constraint, FreeTime, Parameter
from solvers.internal import Cause

FREE = Box()

COSTS = (
    Mistake(
        "force times two instead of squared",
        Cause.LINEAR_COST,
        "force",
        lambda: of.cart(running_cost=lambda s: s.force * 2, control_bounds=FREE),
    ),
    Mistake(
        "square left out for the control",
        Cause.LINEAR_COST,
        "u",
        lambda: of.oscillator(running_cost=lambda s: (s.x1**2 + s.x2**2 + s.u) / 2),
    ),
    Mistake(
        "torque bounded on one side only",
        Cause.LINEAR_COST,
        "torque",
        lambda: of.pendulum(
            running_cost=lambda s: s.angle**2 + 0.5 * s.torque, control_bounds=Box(upper=2.0)
        ),
    ),
    Mistake(
        "power instead of energy",
        Cause.LINEAR_COST,
        "push",
        lambda: of.car(running_cost=lambda s: s.push * s.speed + s.turn**2, control_bounds=FREE),
    ),
    Mistake(
        "one of two rotors not squared",
        Cause.LINEAR_COST,
        "lift",
        lambda: of.drone(running_cost=lambda s: (s.lift - 9.81) + s.roll**2, control_bounds=FREE),
        held_out=True,
    ),
    Mistake(
        "voltage not squared",
        Cause.LINEAR_COST,
        "voltage",
        lambda: of.servo(running_cost=lambda s: (s.spot - s.wanted) ** 2 + 0.01 * s.voltage),
        held_out=True,
    ),
    Mistake(
        "force costs nothing",
        Cause.FREE_CONTROL,
        "force",
        lambda: of.cart(running_cost=lambda s: (s.position - 1) ** 2, control_bounds=FREE),
    ),
    Mistake(
        "turning forgotten in the cost",
        Cause.FREE_CONTROL,
        "turn",
        lambda: of.car(running_cost=lambda s: s.push**2, control_bounds=FREE),
    ),
    Mistake(
        "minimum time without a bound",
        Cause.FREE_CONTROL,
        "force",
        lambda: of.fastest(control_bounds=FREE),
    ),
    Mistake(
        "push forgotten in the cost",
        Cause.FREE_CONTROL,
        "push",
        lambda: of.cartpole(running_cost=lambda s: s.rail**2 + 10 * s.lean**2, control_bounds=FREE),
        held_out=True,
    ),
    Mistake(
        "joint speed forgotten in the cost",
        Cause.FREE_CONTROL,
        "w2",
        lambda: of.arm(running_cost=lambda s: s.w1**2, control_bounds=FREE),
        held_out=True,
    ),
    Mistake(
        "minus before the effort",
        Cause.WRONG_SIGN,
        "force",
        lambda: of.cart(running_cost=lambda s: -(s.force**2)),
    ),
    Mistake(
        "minus before an unbounded effort",
        Cause.WRONG_SIGN,
        "u",
        lambda: of.oscillator(running_cost=lambda s: s.x1**2 + s.x2**2 - s.u**2),
    ),
    Mistake(
        "terminal cost maximised",
        Cause.WRONG_SIGN,
        "angle",
        lambda: of.pendulum(terminal_cost=lambda s: -10 * ((s.angle - 1.5) ** 2 + s.rate**2)),
    ),
    Mistake(
        "tracking error maximised",
        Cause.WRONG_SIGN,
        "level",
        lambda: of.tank(running_cost=lambda s: 0.1 * s.inflow**2 - (s.level - 2) ** 2),
    ),
    Mistake(
        "one negative weight",
        Cause.WRONG_SIGN,
        "w2",
        lambda: of.arm(running_cost=lambda s: s.w1**2 - 0.5 * s.w2**2),
    ),
    Mistake(
        "reward form kept from reinforcement learning",
        Cause.WRONG_SIGN,
        "lean",
        lambda: of.cartpole(
            running_cost=lambda s: 0.05 * s.push**2 - s.rail**2 - 10 * s.lean**2, terminal_cost=0.0
        ),
    ),
    Mistake(
        "negative weight in discrete time",
        Cause.WRONG_SIGN,
        "u",
        lambda: of.regulator(running_cost=lambda s: s.place**2 + s.pace**2 - s.u**2),
        held_out=True,
    ),
    Mistake(
        "reference error maximised",
        Cause.WRONG_SIGN,
        "spot",
        lambda: of.servo(
            running_cost=lambda s: 0.01 * s.voltage**2 - (s.spot - s.wanted) ** 2,
            control_bounds=Box(-5.0, 5.0),
        ),
        held_out=True,
    ),
    Mistake(
        "cubed instead of squared",
        Cause.UNBOUNDED,
        "velocity",
        lambda: of.cart(
            running_cost=lambda s: s.force**2 + s.velocity**3,
            control_bounds=FREE,
            constraints=(),
        ),
    ),
    Mistake(
        "terminal cost of odd power",
        Cause.UNBOUNDED,
        "position",
        lambda: of.cart(
            terminal_cost=lambda s: (s.position - 1) ** 3, control_bounds=FREE, constraints=()
        ),
    ),
    Mistake(
        "fifth power in discrete time",
        Cause.UNBOUNDED,
        "place",
        lambda: of.regulator(
            running_cost=lambda s: s.place**5 + s.u**2, terminal_cost=0.0, control_bounds=FREE
        ),
        held_out=True,
    ),
    Mistake(
        "target forgotten",
        Cause.NO_GOAL,
        "force",
        lambda: of.cart(constraints=()),
    ),
    Mistake(
        "joint speeds only",
        Cause.NO_GOAL,
        "w1",
        lambda: of.arm(constraints=()),
    ),
    Mistake(
        "fuel and no landing",
        Cause.NO_GOAL,
        "thrust",
        lambda: of.lander(constraints=(), state_bounds=Box(), horizon=10.0),
    ),
    Mistake(
        "terminal cost forgotten",
        Cause.NO_GOAL,
        "torque",
        lambda: of.pendulum(terminal_cost=0.0),
        held_out=True,
    ),
    Mistake(
        "time rewarded, nothing to reach",
        Cause.VANISHING_TIME,
        "final time",
        lambda: of.lander(
            horizon=FreeTime(guess=15.0), constraints=(), running_cost=1.0, terminal_cost=0.0
        ),
    ),
    Mistake(
        "target is the start",
        Cause.VANISHING_TIME,
        "final time",
        lambda: of.fastest(
            horizon=FreeTime(guess=2.0), constraints=of.ends({"position": 0.0, "velocity": 0.0})
        ),
    ),
    Mistake(
        "time weighs a thousand times the target",
        Cause.VANISHING_TIME,
        "final time",
        lambda: of.pendulum(horizon=FreeTime(guess=3.0), running_cost=lambda s: 1000 + s.torque**2),
        held_out=True,
    ),
    Mistake(
        "least energy with all the time in the world",
        Cause.ENDLESS_TIME,
        "final time",
        lambda: of.cart(horizon=FreeTime(guess=2.0, lower=0.5)),
    ),
    Mistake(
        "time rewarded instead of charged",
        Cause.ENDLESS_TIME,
        "final time",
        lambda: of.arm(
            horizon=FreeTime(guess=1.0, lower=0.2), running_cost=lambda s: s.w1**2 + s.w2**2 - 1
        ),
    ),
    Mistake(
        "joint speeds with a free time",
        Cause.ENDLESS_TIME,
        "final time",
        lambda: of.arm(horizon=FreeTime(guess=1.0, lower=0.2)),
        held_out=True,
    ),
    Mistake(
        "parameter declared, number typed",
        Cause.UNUSED,
        "weight",
        lambda: of.cart(
            symbols=("weight",), parameters=lambda s: (Parameter("weight", s.weight, 1.0),)
        ),
    ),
    Mistake(
        "reference forgotten in the cost",
        Cause.UNUSED,
        "reference",
        lambda: of.servo(running_cost=lambda s: s.spot**2 + 0.01 * s.voltage**2),
    ),
    Mistake(
        "state of energy nobody looks at",
        Cause.UNUSED,
        "spent",
        lambda: of.cart(
            states={"spent": "J"},
            f=lambda s: (s.velocity, s.force / 2, s.force * s.velocity),
            x0=[0.0, 0.0, 0.0],
        ),
        held_out=True,
    ),
    Mistake(
        "absolute value declared smooth",
        Cause.KINK,
        "force",
        lambda: of.cart(running_cost=lambda s: ca.fabs(s.force) + 0.01 * s.force**2),
    ),
    Mistake(
        "comfort band as a maximum",
        Cause.KINK,
        "warmth",
        lambda: of.room(running_cost=lambda s: s.heater + 5 * ca.fmax(0, 21 - s.warmth)),
    ),
    Mistake(
        "usage counted by its absolute value (do-mpc issue 459)",
        Cause.KINK,
        "heater",
        lambda: of.room(
            f=lambda s: ((5.0 - s.warmth) / 4 + 6.0 * ca.fabs(s.heater),),
            control_bounds=Box(-2.0, 2.0),
            running_cost=lambda s: s.heater**2,
        ),
    ),
    Mistake(
        "price that jumps",
        Cause.KINK,
        "level",
        lambda: of.tank(
            running_cost=lambda s: (
                ca.if_else(s.level > 1.5, 1.0, 4.0) * s.inflow**2 + (s.level - 2) ** 2
            )
        ),
        held_out=True,
    ),
    Mistake(
        "distance to the nearer of two targets",
        Cause.KINK,
        "angle",
        lambda: of.pendulum(
            terminal_cost=lambda s: 10 * ca.fmin((s.angle - 1) ** 2, (s.angle + 1) ** 2)
        ),
        held_out=True,
    ),
    Mistake(
        "weights of very different size",
        Cause.BAD_SCALING,
        "force",
        lambda: of.cart(
            running_cost=lambda s: 1e9 * (s.position - 1) ** 2 + 1e-6 * s.force**2, constraints=()
        ),
    ),
    Mistake(
        "orbit in metres, attitude in radians",
        Cause.BAD_SCALING,
        "altitude",
        lambda: of.cart(
            states={"altitude": "m"},
            f=lambda s: (s.velocity, s.force / 2, 1e3 * s.velocity),
            x0=[0.0, 0.0, 7e6],
        ),
    ),
    Mistake(
        "traces beside pressure",
        Cause.BAD_SCALING,
        "pressure",
        lambda: of.tank(
            states={"pressure": "Pa", "trace": "mol/l"},
            f=lambda s: (
                s.inflow - 0.5 * ca.sqrt(s.level),
                1e4 * (s.inflow - 0.5),
                1e-7 * (s.inflow - s.trace * 1e6),
            ),
            x0=[1.0, 1e6, 1e-6],
            state_bounds=Box([0.1, 0.0, 0.0], [10.0, 1e7, 1e-5]),
            running_cost=lambda s: (
                (s.level - 2) ** 2
                + (s.pressure / 1e6) ** 2
                + 0.1 * s.inflow**2
                + (1e6 * s.trace) ** 2
            ),
        ),
        held_out=True,
    ),
    Mistake(
        "constraint that no bound was given to",
        Cause.VACUOUS,
        "obstacle",
        lambda: of.car(
            constraints=lambda s: (
                *of.ends({"x": 10.0, "y": 0.0, "speed": 0.0})(s),
                Constraint("obstacle", (s.x - 5) ** 2 + (s.y - 0.3) ** 2),
            )
        ),
    ),
    Mistake(
        "target without numbers",
        Cause.VACUOUS,
        "target",
        lambda: of.arm(constraints=lambda s: (Constraint("target", of.hand(s), at="terminal"),)),
    ),
    Mistake(
        "constraint of a number",
        Cause.VACUOUS,
        "comfort",
        lambda: of.room(
            constraints=lambda s: (Constraint("comfort", 0 * s.warmth + 20.5, 20.0, 24.0),)
        ),
        held_out=True,
    ),
)
