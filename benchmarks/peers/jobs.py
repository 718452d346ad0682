"""The jobs: the arm, the cart-pole and a linear plant, open loop and step by step."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from benchmarks.cases.arm import arm_scenario
from benchmarks.peers.job import Job, Situation
from benchmarks.speed import linear as linear_speed
from models import cart_pole_swing_up, cart_pole_upright, mass_spring_damper
from ocp import OCP, RK4, Guess
from ocp.internal import Stage
from solvers import MultipleShooting

SCENARIO = "arm-001"
# Rate at which an error of the end effector decays in the closed loop (3.18) [1/s].
CORRECTION = 5.0
# Steps of the closed loops from which the situations come.
STEPS = 20
# Standard deviation of a measured joint [rad], so that no step starts at its own solution.
NOISE = 1e-3


@dataclass(frozen=True)
class NamedJob:
    """A job that is made only when it is asked for.

    Attributes:
        name: what a user types.
        about: what it is.
        make: makes it.
    """

    name: str
    about: str
    make: Callable[[], Job]


@cache
def arm_open_loop() -> Job:
    """The three-link arm over its whole task, N = 75."""
    ocp = arm_scenario(SCENARIO).ocp("sum")
    return Job(
        name="arm",
        title=f"arm, 3 links, {SCENARIO} (sum), open loop over 1.5 s, N = 75",
        ocp=ocp,
        intervals=75,
        situations=(Situation(ocp.start()),),
    )


@cache
def arm_mpc() -> Job:
    """Steps of model predictive control on the same arm, horizon 0.7 s, N = 35."""
    ocp = replace(arm_scenario(SCENARIO), horizon=0.7).ocp("sum", correction=CORRECTION)
    return Job(
        name="arm-mpc",
        title="arm, 3 links, steps of MPC every 20 ms, horizon 0.7 s, N = 35",
        ocp=ocp,
        intervals=35,
        situations=_loop(ocp, 35, NOISE),
    )


@cache
def cart_pole_open_loop() -> Job:
    """The swing-up of [Kelly 2017], N = 100."""
    ocp = cart_pole_swing_up()
    return Job(
        name="cart-pole",
        title="cart-pole, swing-up in 2 s, end prescribed, N = 100",
        ocp=ocp,
        intervals=100,
        situations=(Situation(ocp.start()),),
    )


@cache
def cart_pole_mpc() -> Job:
    """Steps of a controller that brings the pole up, horizon 1 s, N = 40."""
    start, upright = np.array([0.0, np.pi - 0.4, 0.0, 0.0]), np.array([0.0, np.pi, 0.0, 0.0])
    # Without a guess everybody falls into the optimum that swings the long way round.
    guess = Guess(x=[start, upright], u=[0.0])
    ocp = replace(cart_pole_upright(track=np.inf), x0=start, guess=guess)
    return Job(
        name="cart-pole-mpc",
        title="cart-pole, steps of MPC every 25 ms to the upright pole, horizon 1 s, N = 40",
        ocp=ocp,
        intervals=40,
        situations=_loop(ocp, 40, 0.0),
    )


@cache
def linear_mpc() -> Job:
    """Constrained tracking with the mass (2.92): situations in which a bound is active."""
    steps, plant = linear_speed.PEER_HORIZON, mass_spring_damper().sampled(linear_speed.DT)
    seen = linear_speed.situations(steps, STEPS + 1)
    return Job(
        name="linear",
        title=f"linear constrained MPC, mass (2.92), steps every 50 ms, N = {steps}",
        ocp=linear_speed.mass_tracking(steps),
        intervals=steps,
        situations=tuple(Situation(s.x, s.t, {"reference": s.ahead}) for s in seen),
        linear={
            "A": plant.A,
            "B": plant.B,
            "Q": linear_speed.STATE_WEIGHT * np.eye(2),
            "R": linear_speed.INPUT_WEIGHT * np.eye(1),
            "P": linear_speed.END_WEIGHT * np.eye(2),
        },
    )


JOBS: tuple[NamedJob, ...] = (
    NamedJob("arm", "3-link arm, open loop, N = 75", arm_open_loop),
    NamedJob("arm-mpc", "3-link arm, steps of MPC, N = 35", arm_mpc),
    NamedJob("cart-pole", "cart-pole swing-up, open loop, N = 100", cart_pole_open_loop),
    NamedJob("cart-pole-mpc", "cart-pole, steps of MPC, N = 40", cart_pole_mpc),
    NamedJob("linear", "constrained linear MPC, N = 20", linear_mpc),
)


def _loop(ocp: OCP, intervals: int, noise: float) -> tuple[Situation, ...]:
    """Return what our own controller meets: plan, hold the first control, measure, plan anew."""
    dt, rng = ocp.duration / intervals, np.random.default_rng(0)
    program = MultipleShooting(intervals).build(ocp)
    move = Stage.of(ocp, RK4(steps=5), held=True).step
    x, seen, plan = ocp.start(), [], None
    for k in range(STEPS + 1):
        measured = x + noise * rng.normal(size=x.shape)
        seen.append(Situation(measured, k * dt))
        plan = program.run(x0=measured, t0=k * dt, guess=plan).or_raise()
        x = np.array(move(x, plan.u[0], k * dt, dt, [], [])[0]).ravel()
    return tuple(seen)
