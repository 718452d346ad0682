"""Mistakes in bounds, constraints and the start: no trajectory, or not the one that was meant."""

import casadi as ca
import numpy as np

from benchmarks.mistakes import problems as of
from benchmarks.mistakes.mistake import Mistake
from ocp import Box, Constraint, Guess
from solvers.internal import Cause

CAR_ENDS = of.ends({"x": 10.0, "y": 0.0, "speed": 0.0})

CONSTRAINTS = (
    Mistake(
        "half a second for a metre",
        Cause.OUT_OF_REACH,
        "end position",
        lambda: of.cart(horizon=0.5),
    ),
    Mistake(
        "force in the wrong unit",
        Cause.OUT_OF_REACH,
        "force",
        lambda: of.cart(control_bounds=Box(-0.01, 0.01)),
    ),
    Mistake(
        "ten metres in a second",
        Cause.OUT_OF_REACH,
        "end x",
        lambda: of.car(horizon=1.0),
    ),
    Mistake(
        "slow joints",
        Cause.OUT_OF_REACH,
        "target",
        lambda: of.arm(control_bounds=Box(-0.2, 0.2)),
    ),
    Mistake(
        "three steps to rest",
        Cause.OUT_OF_REACH,
        "rest",
        lambda: of.regulator(
            horizon=3,
            constraints=lambda s: (
                Constraint("rest", ca.vertcat(s.place, s.pace), 0.0, 0.0, at="terminal"),
            ),
        ),
        held_out=True,
    ),
    Mistake(
        "a pole caught in no time",
        Cause.OUT_OF_REACH,
        "end lean",
        lambda: of.cartpole(
            horizon=0.3, constraints=of.ends({"lean": 0.0, "spin": 0.0, "speed": 0.0})
        ),
        held_out=True,
    ),
    Mistake(
        "weak rotors, far target",
        Cause.OUT_OF_REACH,
        "end px",
        lambda: of.drone(horizon=1.0, control_bounds=Box([0.0, -3.0], [12.0, 3.0])),
        held_out=True,
    ),
    Mistake(
        "arrival faster than allowed",
        Cause.CONTRADICTION,
        "velocity",
        lambda: of.cart(
            constraints=of.ends({"position": 1.0, "velocity": 3.0}),
            state_bounds=Box([-np.inf, -2.0], [np.inf, 2.0]),
        ),
    ),
    Mistake(
        "upright beyond the stop",
        Cause.CONTRADICTION,
        "angle",
        lambda: of.pendulum(
            constraints=of.ends({"angle": np.pi}),
            state_bounds=Box([-3.0, -np.inf], [3.0, np.inf]),
        ),
    ),
    Mistake(
        "parking place in the obstacle",
        Cause.CONTRADICTION,
        "obstacle",
        lambda: of.car(
            constraints=lambda s: (
                *of.ends({"x": 5.0, "y": 0.0, "speed": 0.0})(s),
                Constraint("obstacle", (s.x - 5) ** 2 + (s.y - 0.3) ** 2, lower=1.0),
            )
        ),
    ),
    Mistake(
        "target longer than the arm",
        Cause.CONTRADICTION,
        "target",
        lambda: of.arm(constraints=of.reach((1.9, 1.6))),
    ),
    Mistake(
        "more inflow than the pump has",
        Cause.CONTRADICTION,
        "inflow",
        lambda: of.tank(constraints=lambda s: (Constraint("supply", s.inflow, lower=3.0),)),
    ),
    Mistake(
        "two targets, one copied",
        Cause.CONTRADICTION,
        "goal",
        lambda: of.cart(
            constraints=lambda s: (
                Constraint("goal", s.position, 1.0, 1.0, at="terminal"),
                Constraint("parking", s.position, 2.0, 2.0, at="terminal"),
            )
        ),
        held_out=True,
    ),
    Mistake(
        "tilted flight with too little lift",
        Cause.CONTRADICTION,
        "lift",
        lambda: of.drone(
            constraints=lambda s: (
                *of.ends({"px": 2.0})(s),
                Constraint("climb", s.lift * ca.cos(s.tilt), lower=25.0),
            )
        ),
        held_out=True,
    ),
    Mistake(
        "target as a path constraint",
        Cause.START_VIOLATES,
        "end",
        lambda: of.cart(
            constraints=lambda s: (Constraint("end", s.position, 1.0, 1.0, at="path"),)
        ),
    ),
    Mistake(
        "start inside the obstacle",
        Cause.START_VIOLATES,
        "obstacle",
        lambda: of.car(x0=[4.5, 0.0, 0.0, 0.0]),
    ),
    Mistake(
        "cold start in a warm room",
        Cause.START_VIOLATES,
        "comfort",
        lambda: of.room(
            x0=[18.0],
            state_bounds=Box(),
            constraints=lambda s: (Constraint("comfort", s.warmth, 20.0, 24.0),),
        ),
    ),
    Mistake(
        "already too fast",
        Cause.START_VIOLATES,
        "speed limit",
        lambda: of.pendulum(
            x0=[0.0, 1.5], constraints=lambda s: (Constraint("speed limit", s.rate, -1.0, 1.0),)
        ),
        held_out=True,
    ),
    Mistake(
        "hand below the table at the start",
        Cause.START_VIOLATES,
        "table",
        lambda: of.arm(
            x0=[-0.6, 0.2],
            constraints=lambda s: (
                *of.reach((0.4, 1.2))(s),
                Constraint("table", of.hand(s)[1], lower=0.0),
            ),
        ),
        held_out=True,
    ),
    Mistake(
        "corridor blocked by the obstacle",
        Cause.CONFLICT,
        "obstacle",
        lambda: of.car(
            state_bounds=Box([-np.inf, -0.5, -np.inf, -np.inf], [np.inf, 0.5, np.inf, np.inf])
        ),
    ),
    Mistake(
        "forward, but only backwards allowed",
        Cause.CONFLICT,
        "velocity",
        lambda: of.cart(state_bounds=Box([-np.inf, -5.0], [np.inf, 0.0])),
    ),
    Mistake(
        "heater too weak for the comfort",
        Cause.CONFLICT,
        "heater",
        lambda: of.room(control_bounds=Box(0.0, 0.2)),
    ),
    Mistake(
        "engine weaker than gravity",
        Cause.CONFLICT,
        "thrust",
        lambda: of.lander(control_bounds=Box(0.0, 120.0)),
    ),
    Mistake(
        "wall behind the brake's reach",
        Cause.CONFLICT,
        "position",
        lambda: of.cart(
            x0=[0.0, 1.0],
            control_bounds=Box(-1.0, 1.0),
            state_bounds=Box([-np.inf, -np.inf], [0.1, np.inf]),
            constraints=(),
        ),
    ),
    Mistake(
        "pump too small for the level",
        Cause.CONFLICT,
        "inflow",
        lambda: of.tank(
            control_bounds=Box(0.0, 0.8), constraints=of.ends({"level": 4.0}), horizon=30.0
        ),
        held_out=True,
    ),
    Mistake(
        "speed limit of zero",
        Cause.CONFLICT,
        "speed",
        lambda: of.car(
            state_bounds=Box([-np.inf, -np.inf, -np.inf, 0.0], [np.inf, np.inf, np.inf, 0.0])
        ),
        held_out=True,
    ),
    Mistake(
        "second wagon not coupled",
        Cause.UNREACHABLE,
        "wagon",
        lambda: of.cart(
            states={"wagon": "m"},
            f=lambda s: (s.velocity, s.force / 2, -0.1 * s.wagon),
            x0=[0.0, 0.0, 0.5],
            constraints=of.ends({"position": 1.0, "wagon": 1.0}),
        ),
    ),
    Mistake(
        "mass that does not burn",
        Cause.UNREACHABLE,
        "mass",
        lambda: of.lander(
            f=lambda s: (s.speed, s.thrust / s.mass - 1.62, 0.0),
            constraints=of.ends({"height": 0.0, "speed": 0.0, "mass": 95.0}),
            running_cost=lambda s: 1e-3 * s.thrust,
            terminal_cost=0.0,
        ),
    ),
    Mistake(
        "two wagons on one force",
        Cause.UNREACHABLE,
        "second",
        lambda: of.cart(
            states={"second": "m", "pace": "m/s"},
            f=lambda s: (s.velocity, s.force / 2, s.pace, s.force / 2),
            x0=[0.0, 0.0, 0.0, 0.0],
            constraints=of.ends({"position": 1.0, "velocity": 0.0, "second": 2.0, "pace": 0.0}),
        ),
    ),
    Mistake(
        "clock that has to be late",
        Cause.UNREACHABLE,
        "clock",
        lambda: of.pendulum(
            states={"clock": "s"},
            f=lambda s: (s.rate, s.torque - ca.sin(s.angle), 1.0),
            x0=[0.0, 0.0, 0.0],
            constraints=of.ends({"clock": 5.0}),
        ),
        held_out=True,
    ),
    Mistake(
        "momentum that inner forces must change",
        Cause.UNREACHABLE,
        "right",
        lambda: of.cart(
            states={"right": "m/s"},
            f=lambda s: (s.velocity, s.force / 2, -s.force),
            x0=[0.0, 0.0, 0.0],
            constraints=of.ends({"position": 1.0, "velocity": 0.0, "right": 1.0}),
        ),
        held_out=True,
    ),
    Mistake(
        "brake forgotten in the dynamics",
        Cause.NO_INFLUENCE,
        "brake",
        lambda: of.cart(more={"brake": "N"}, running_cost=lambda s: s.force**2 + 0.1 * s.brake**2),
    ),
    Mistake(
        "steering has no effect",
        Cause.NO_INFLUENCE,
        "turn",
        lambda: of.car(
            f=lambda s: (s.speed * ca.cos(s.heading), s.speed * ca.sin(s.heading), 0.0, s.push)
        ),
    ),
    Mistake(
        "torque replaced by a number",
        Cause.NO_INFLUENCE,
        "torque",
        lambda: of.pendulum(f=lambda s: (s.rate, 1.0 - ca.sin(s.angle))),
    ),
    Mistake(
        "roll typed as a state",
        Cause.NO_INFLUENCE,
        "roll",
        lambda: of.drone(
            f=lambda s: (
                s.vx,
                s.vz,
                -s.lift * ca.sin(s.tilt),
                s.lift * ca.cos(s.tilt) - 9.81,
                s.tilt,
            )
        ),
        held_out=True,
    ),
    Mistake(
        "end said twice",
        Cause.DUPLICATE,
        "goal",
        lambda: of.cart(
            constraints=lambda s: (
                *of.ends({"position": 1.0, "velocity": 0.0})(s),
                Constraint("goal", s.position, 1.0, 1.0, at="terminal"),
            )
        ),
    ),
    Mistake(
        "a sum of ends that are given already",
        Cause.DUPLICATE,
        "sum",
        lambda: of.cart(
            constraints=lambda s: (
                *of.ends({"position": 1.0, "velocity": 0.0})(s),
                Constraint("sum", s.position + 3 * s.velocity, 1.0, 1.0, at="terminal"),
            )
        ),
    ),
    Mistake(
        "closed chain written redundantly",
        Cause.DUPLICATE,
        "reach",
        lambda: of.arm(
            constraints=lambda s: (
                *of.reach((0.4, 1.2))(s),
                Constraint("reach", ca.sumsqr(of.hand(s)), 1.6, 1.6, at="terminal"),
            )
        ),
        held_out=True,
    ),
    Mistake(
        "guess beyond the bounds",
        Cause.GUESS_OUTSIDE,
        "force",
        lambda: of.cart(guess=Guess(u=[50.0])),
    ),
    Mistake(
        "guess below the bottom",
        Cause.GUESS_OUTSIDE,
        "level",
        lambda: of.tank(guess=Guess(x=[[1.0], [-1.0]])),
        held_out=True,
    ),
    Mistake(
        "obstacle far from everything",
        Cause.INACTIVE,
        "obstacle",
        lambda: of.car(
            constraints=lambda s: (
                *CAR_ENDS(s),
                Constraint("obstacle", (s.x - 500) ** 2 + (s.y - 0.3) ** 2, lower=1.0),
            )
        ),
    ),
)
