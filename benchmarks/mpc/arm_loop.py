"""The arm in closed loop: the problem over one horizon, the plant, and every controller.

The plant is the velocity form of the scenario: the controller sends joint velocities, held
for an interval (Algorithm 3). The task ends at T = 1.5 s: from then on the prescribed path
stands still and the distance cost is off, so that a horizon as long as the task sees exactly
what the finite-horizon optimum sees, and nothing beyond. A simulation of 0.8 s is the first
part of the same loop; its controllers look beyond its end, as those of the thesis do.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import casadi as ca

from benchmarks.methods.tuned_kinematics import instantaneous, tuned_kinematics
from models import ArmScenario, DistanceCost, Path, redundancy_ocp
from ocp import (
    MPC,
    OCP,
    Box,
    FeedbackLaw,
    Plant,
    PlantInput,
    Rollout,
    Solution,
    Solver,
    closed_loop,
    solve,
)
from solvers import (
    FixedStep,
    IndirectShooting,
    MultipleShooting,
    Repulsion,
    Schuetz,
    StagewiseNewton,
)

DT = 0.02  # [s]
CORRECTION = 10.0  # K of (3.18) [1/s]
FASTEST = 10.0  # [rad/s]
JOINTS = Box(-FASTEST, FASTEST)
_ROUNDING = 1e-9

Make = Callable[[int], Solver]
# Intervals -> solver. The step length 0.01 is that of the thesis' table in 3.2.6.
SOLVERS: dict[str, Make] = {
    "direct": lambda n: MultipleShooting(n, backend="fatrop"),
    "newton": lambda n: StagewiseNewton(n),
    "shooting": lambda n: IndirectShooting(steps=n, tolerance=1e-8),
    "schuetz": lambda n: Schuetz(intervals=n, step=FixedStep(0.01)),
    "schuetz-sound": lambda n: Schuetz.sound(intervals=n),
}
INSTANTANEOUS = "instantaneous"


def intervals(horizon: float) -> int:
    """Return N: none is shorter than a sampling interval, which holds one control."""
    return max(1, int(horizon / DT + _ROUNDING))


def problem(scenario: ArmScenario, horizon: float) -> OCP:
    """Return the problem over one horizon [s] of a task that ends at ``scenario.horizon``."""
    end, t = scenario.horizon, ca.SX.sym("t")
    ocp = redundancy_ocp(
        scenario.arm,
        _stopping(scenario.path, end),
        theta0=scenario.theta0,
        horizon=horizon,
        obstacles=(scenario.disc,),
        distance_cost=DistanceCost(scenario.gain, scenario.influence, "sum"),
        correction=CORRECTION,
        t=t,
        name=f"{scenario.name} over {horizon:g} s",
    )
    on = ca.if_else(t < end - _ROUNDING, 1.0, 0.0)
    rest = ca.sumsqr(ocp.model.u)
    return replace(ocp, running_cost=rest + on * (ocp.running_cost - rest))


def _stopping(path: Path, end: float) -> Path:
    return lambda t: path(ca.fmin(t, end))


def plant(scenario: ArmScenario) -> Plant:
    """Return the arm that takes joint velocities, judged by the cost of the task."""
    return Plant(ocp=scenario.ocp("sum", form="velocity"))


def controller(kind: str, ocp: OCP, **options: float) -> MPC:
    """Return a receding horizon around one of ``SOLVERS``.

    Single shooting gets its first guess from the direct solution: from psi = 0 it may find a
    spurious extremal, and the warm start then keeps it there.

    Args:
        kind: of ``SOLVERS``.
        ocp: over one horizon.
        options: ``delay`` and ``compensate`` of ``MPC``.
    """
    return MPC(
        ocp=ocp,
        solver=SOLVERS[kind](intervals(ocp.duration)),
        dt=DT,
        applied=PlantInput("rate", JOINTS),
        guess=_first(ocp) if kind == "shooting" else None,
        delay=options.get("delay", 0.0),
        compensate=bool(options.get("compensate", True)),
    )


def _first(ocp: OCP) -> Solution:
    return solve(ocp, MultipleShooting(intervals(ocp.duration)))


@cache
def tuned(scenario: ArmScenario) -> Repulsion:
    """Return the best gains of instantaneous control for the whole task."""
    return tuned_kinematics(scenario, "sum").repulsion


def law(scenario: ArmScenario, repulsion: Repulsion) -> FeedbackLaw:
    """Return instantaneous control (3.19) in the same loop, with the same feedback K."""
    program = instantaneous(scenario, repulsion, feedback=CORRECTION).build()
    return FeedbackLaw(law=program.velocity, bounds=JOINTS)


def loop(scenario: ArmScenario, kind: str, horizon: float) -> Rollout:
    """Run one closed loop over the whole task.

    Args:
        scenario: arm, path and disc.
        kind: of ``SOLVERS``, or ``INSTANTANEOUS``, for which the horizon does not count.
        horizon: [s].
    """
    run = partial(closed_loop, plant=plant(scenario), x0=scenario.theta0, dt=DT)
    duration = DT * round(scenario.horizon / DT)
    if kind != INSTANTANEOUS:
        return run(controller(kind, problem(scenario, horizon)), duration=duration)
    return run(law(scenario, tuned(scenario)), duration=duration)
