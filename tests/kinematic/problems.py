"""Arms, tasks and scenarios for the tests of instantaneous control."""

import casadi as ca
import numpy as np

from benchmarks.cases import arm_scenario
from models import Disc, PlanarArm, link_distances
from solvers import Repulsion, Task, repel, track

T = ca.SX.sym("t")
ARM = PlanarArm((1.0, 0.8, 0.6, 0.5))
Q = ca.SX.sym("q", 4)
START = np.array([1.1, -0.7, -0.6, -0.5])
SCENARIO = arm_scenario("arm-001")
Q3 = ca.SX.sym("q", 3)
REPULSION = Repulsion(v0=0.5, d_m=0.5, d_i=0.8)


def position(velocity: tuple[float, float] = (0.2, -0.1), gain: float = 10.0) -> Task:
    """The end effector of ``ARM`` leaves its start on a straight line."""
    start = ca.DM(ARM.end_effector(START))
    return track(
        "position",
        q=Q,
        t=T,
        value=ARM.end_effector(Q),
        desired=start + T * ca.DM(velocity),
        gain=gain,
    )


def orientation(desired: float = -0.7, gain: float = 5.0) -> Task:
    return track(
        "orientation", q=Q, t=T, value=ARM.orientation(Q), desired=desired, gain=gain, angular=True
    )


def away(disc: Disc, name: str = "obstacle", repulsion: Repulsion = REPULSION) -> Task:
    return repel(name, q=Q, t=T, distance=link_distances(ARM, Q, disc), repulsion=repulsion)


def follow_scenario(gain: float = 100.0) -> Task:
    """The first task of arm-001."""
    arm = SCENARIO.arm
    return track(
        "end effector",
        q=Q3,
        t=T,
        value=arm.end_effector(Q3),
        desired=SCENARIO.path(T),
        gain=gain,
    )


def avoid_scenario(repulsion: Repulsion = REPULSION) -> Task:
    """The second task of arm-001."""
    distances = link_distances(SCENARIO.arm, Q3, SCENARIO.disc)
    return repel("obstacle", q=Q3, t=T, distance=distances, repulsion=repulsion)
