"""A cart, an arm and a heated room that run for ever, and can be asked for what is not possible."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import cast

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from benchmarks.mpc.altered import Altered
from benchmarks.mpc.faulty import Fault, Schedule, Spoiled, active
from models import Disc, DistanceCost, PlanarArm, redundancy_ocp
from ocp import MPC, OCP, Box, Constraint, Model, Parameter, Plant, PlantInput, Rate
from solvers import LinearMPC, MultipleShooting, PrioritisedKinematics, track

MISMATCH = 0.3
_FORCE, _FASTEST, _ASIDE = 2.0, 1.5, 3.0
_JOINTS = 6.0  # [rad/s]
_NOWHERE = 50.0  # [m], for the cart
_OUT_OF_REACH = 2.0  # [m], for the arm
# A step that has to answer in time gives up early; fatrop alone would sometimes never do so.
_SOLVER = MultipleShooting(
    8,
    backend="fatrop",
    max_iterations=40,
    compiled=True,
    time_limit=1.0,
    feasibility_restoration=False,
)
_START, _FAR = (2.0, -1.0, -1.0), (5.0, 5.0)
# Beside the elbow, where the arm can give way, and on the path, where it cannot.
_BESIDE, _IN_THE_WAY = (0.3, 1.1), (1.25, 1.75)
_CLEARANCE = 0.15
# What an input of the plant is worth.
_GAIN = ca.SX.sym("gain")


@dataclass(frozen=True, eq=False, kw_only=True)
class FaultProblem:
    """What a campaign is run on.

    Attributes:
        mpc: the controller, its solver failing on the schedule.
        plant: the truth, another one on the schedule.
        x0: first state.
    """

    mpc: MPC
    plant: Plant
    x0: tuple[float, ...]


def cart(faults: Schedule) -> FaultProblem:
    """Return a cart of 1 kg that goes to and fro between targets.

    |force| <= 2 N, |speed| <= 1.5 m/s, a wall that it must not pass, and it must get within
    3 m of the target in 0.8 s. A target 50 m away, or a wall behind the cart, cannot be met.
    """
    dt, x, u = 0.1, ca.SX.sym("x", 2), ca.SX.sym("u")
    target, wall = ca.SX.sym("target"), ca.SX.sym("wall")
    ocp = OCP(
        name="cart",
        model=Model(name="cart", x=x, u=u, f=ca.vertcat(x[1], u)),
        x0=[0.0, 0.0],
        horizon=0.8,
        running_cost=10.0 * (x[0] - target) ** 2 + x[1] ** 2 + 0.1 * u**2,
        terminal_cost=20.0 * (x[0] - target) ** 2 + 5.0 * x[1] ** 2,
        control_bounds=Box(-_FORCE, _FORCE),
        constraints=(
            Constraint("speed", x[1], -_FASTEST, _FASTEST),
            Constraint("wall", x[0] - wall, upper=0.0),
            Constraint("arrive", x[0] - target, -_ASIDE, _ASIDE, at="terminal"),
        ),
        parameters=(Parameter("target", target, 0.0), Parameter("wall", wall, 10.0)),
    )

    def wanted(t: float, fault: Fault | None) -> Mapping[str, float]:
        usual = 0.5 * np.sign(np.sin(0.5 * t))
        away = fault is not None and fault.kind == "infeasible target"
        blocked = fault is not None and fault.kind == "obstacle"
        return {"target": _NOWHERE if away else usual, "wall": -2.0 if blocked else 10.0}

    return FaultProblem(
        mpc=MPC(
            ocp=ocp,
            solver=Altered(_SOLVER, Spoiled(dt, faults)),
            dt=dt,
            backup=lambda x, t: [-2.0 * x[0] - 2.0 * x[1]],
            parameters=lambda t: _known(wanted, faults, t, dt),
        ),
        plant=_other(ca.vertcat(x[1], _GAIN * u), x, u, partial(_actual, faults, dt)),
        x0=(0.0, 0.0),
    )


def arm(faults: Schedule) -> FaultProblem:
    """Return an arm that swings its end effector to and fro, a disc beside it.

    No link may come closer than 0.15 m to the disc, no joint turn faster than 6 rad/s. The
    path jumps out of the workspace, or the disc onto it, on the schedule. The backup law is
    instantaneous control with the path as its only task.
    """
    dt, robot = 0.02, PlanarArm((1.0, 1.0, 1.0))
    offset, center, t = ca.SX.sym("offset"), ca.SX.sym("center", 2), ca.SX.sym("t")
    first = ca.DM(robot.end_effector(_START))

    def path(t: ca.SX) -> ca.SX:
        return first + ca.vertcat(0.3 * ca.sin(2.0 * t) + offset, 0.0)

    ocp = redundancy_ocp(
        robot,
        path,
        theta0=_START,
        horizon=0.16,
        obstacles=(Disc(center, 0.1),),
        distance_cost=DistanceCost(10.0, 0.6, "sum"),
        correction=5.0,
        clearance=_CLEARANCE,
        velocity_bounds=Box(-_JOINTS, _JOINTS),
        parameters=(Parameter("offset", offset, 0.0), Parameter("center", center, _FAR)),
        t=t,
        name="arm",
    )
    q, u = ca.SX.sym("theta", 3), ca.SX.sym("rate", 3)
    track_only = track("path", q=q, t=t, value=robot.end_effector(q),
                       desired=ca.substitute(path(t), offset, 0.0), gain=5.0)  # fmt: skip
    backup = PrioritisedKinematics((track_only,)).build()

    def wanted(t: float, fault: Fault | None) -> Mapping[str, ArrayLike]:
        away = fault is not None and fault.kind == "infeasible target"
        disc = _FAR
        if fault is not None and fault.kind == "obstacle":
            disc = _IN_THE_WAY if fault.size > 0.0 else _BESIDE
        return {"offset": _OUT_OF_REACH if away else 0.0, "center": disc}

    return FaultProblem(
        mpc=MPC(
            ocp=ocp,
            solver=Altered(_SOLVER, Spoiled(dt, faults)),
            dt=dt,
            applied=PlantInput("rate", Box(-_JOINTS, _JOINTS)),
            backup=backup.velocity,
            parameters=lambda t: _known(wanted, faults, t, dt),
        ),
        plant=_other(_GAIN * u, q, u, partial(_actual, faults, dt)),
        x0=_START,
    )


def heating(faults: Schedule) -> FaultProblem:
    """Return a room of two walls, heated by a valve that moves slowly, for a price.

    The valve is between 0 and what the boiler gives, which varies with time, and changes by at most
    0.2 a step. The warmth is limited softly.
    """
    dt, x, u, t = 1.0, ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("t")
    target, limit = ca.SX.sym("target"), ca.SX.sym("wall")
    warmth, wall = x[0], x[1]
    supply = Constraint("supply", u - 1.0 - 0.4 * ca.sin(0.3 * t), upper=0.0, limits_input=True)
    ocp = OCP(
        name="heating",
        model=Model(
            name="heating",
            x=x,
            u=u,
            t=t,
            f=ca.vertcat(
                warmth + 0.2 * (wall - warmth) + u, wall + 0.1 * (warmth - wall) - 0.05 * wall
            ),
            dt=dt,
        ),
        x0=[2.0, 1.5],
        horizon=10,
        running_cost=0.3 * u + 0.1 * u**2 + (warmth - 3.0 - target) ** 2,
        control_bounds=Box(0.0, 1.5),
        constraints=(supply, Constraint("comfort", warmth - limit, upper=0.0)),
        parameters=(Parameter("target", target, 0.0), Parameter("wall", limit, 10.0)),
        rates=(Rate(u, -0.2, 0.2, weight=0.01),),
        last_input=[0.3],
    )

    def wanted(t: float, fault: Fault | None) -> Mapping[str, float]:
        away = fault is not None and fault.kind == "infeasible target"
        blocked = fault is not None and fault.kind == "obstacle"
        return {"target": _NOWHERE if away else 0.0, "wall": 1.0 if blocked else 10.0}

    m = ocp.model
    truth = _other(
        ca.substitute(m.f, m.u, _GAIN * m.u),
        m.x,
        m.u,
        partial(_actual, faults, dt),
        dt=dt,
    )
    return FaultProblem(
        mpc=MPC(
            ocp=ocp,
            solver=Altered(LinearMPC(soft=100.0), Spoiled(dt, faults)),
            dt=dt,
            parameters=lambda t: _known(wanted, faults, t, dt),
        ),
        plant=truth,
        x0=(2.0, 1.5),
    )


def _known(
    wanted: Callable[[float, Fault | None], Mapping[str, ArrayLike]],
    faults: Schedule,
    t: float,
    dt: float,
) -> Mapping[str, ArrayLike]:
    """Return what is wanted, or nothing, or the error of a line that is down."""
    fault = active(faults, t, dt)
    if fault is not None and fault.kind == "no parameters":
        if fault.size > 0.0:
            raise ConnectionError("on schedule: the line is down")
        return cast(Mapping[str, ArrayLike], None)
    return wanted(t, fault)


def _actual(faults: Schedule, dt: float, t: float) -> Mapping[str, float]:
    """1, or 30 % more or less."""
    fault = active(faults, t, dt)
    if fault is None or fault.kind != "mismatch":
        return {"gain": 1.0}
    return {"gain": 1.0 + (MISMATCH if fault.size > 0.0 else -MISMATCH)}


def _other(
    f: ca.SX,
    x: ca.SX,
    u: ca.SX,
    parameters: Callable,
    *,
    dt: float | None = None,
) -> Plant:
    ocp = OCP(
        name="plant",
        model=Model(name="plant", x=x, u=u, f=f, dt=dt),
        x0=np.zeros(x.numel()),
        horizon=1.0 if dt is None else 1,
        running_cost=ca.sumsqr(u),
        parameters=(Parameter("gain", _GAIN, 1.0),),
    )
    return Plant(ocp=ocp, parameters=parameters, measurement_noise=1e-4)
