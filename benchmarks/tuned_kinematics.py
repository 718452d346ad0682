"""The instantaneous controller of an arm scenario, with gains found by a small search.

A comparison with a badly tuned controller says nothing. So each scenario gets the best of a
fixed grid over the three parameters of the repulsion, judged by the referee:

* v0 = 0.02, 0.05, 0.1, 0.2, 0.4 m/s,
* d_m = 0.4, 0.6, 0.8, 1.0 times the distance of influence of the scenario's cost,
* d_i = 1.2, 1.6, 2.4, 3.2 times d_m,

80 candidates, no random numbers. A candidate counts if its end effector stays within 5 mm of
the path. Sampling interval 10 ms, K = 20 / s, damping only near singularities (``Filtered``).
"""

from dataclasses import dataclass
from itertools import product

import casadi as ca

from models import ArmScenario, Combine, link_distances
from ocp import OCP, Solution, evaluate
from solvers import KinematicRun, PrioritisedKinematics, Repulsion, repel, track

SPEEDS = (0.02, 0.05, 0.1, 0.2, 0.4)
BEGIN = (0.4, 0.6, 0.8, 1.0)
HOMOGENEOUS = (1.2, 1.6, 2.4, 3.2)
SAMPLING = 0.01  # [s]
FEEDBACK = 20.0  # [1/s]
OFF_PATH = 5e-3  # [m]


@dataclass(frozen=True, eq=False)
class Tuned:
    """The best candidate.

    Attributes:
        repulsion: its parameters.
        run: its motion.
        solution: the same, for the referee.
        cost: the referee's, of the problem in velocity form.
        drift: largest distance of the end effector from its path [m].
        tried: number of candidates.
        rejected: how many of them left the path.
    """

    repulsion: Repulsion
    run: KinematicRun
    solution: Solution
    cost: float
    drift: float
    tried: int
    rejected: int


def instantaneous(
    scenario: ArmScenario, repulsion: Repulsion, *, feedback: float = FEEDBACK
) -> PrioritisedKinematics:
    """Return (3.19) for a scenario: the path first, then away from the closest link's obstacle.

    Args:
        scenario: arm, path and disc.
        repulsion: of the second task; distances are from the disc's centre.
        feedback: K of (3.18) [1/s].
    """
    arm, q, t = scenario.arm, ca.SX.sym("theta", scenario.arm.n), ca.SX.sym("t")
    path = track(
        "path", q=q, t=t, value=arm.end_effector(q), desired=scenario.path(t), gain=feedback
    )
    distances = link_distances(arm, q, scenario.disc)
    away = repel("obstacle", q=q, t=t, distance=distances, repulsion=repulsion)
    return PrioritisedKinematics((path, away))


def candidates(scenario: ArmScenario) -> list[Repulsion]:
    """Return the grid of the search."""
    grid = product(SPEEDS, BEGIN, HOMOGENEOUS)
    return [
        Repulsion(v0, begin * scenario.influence, wide * begin * scenario.influence)
        for v0, begin, wide in grid
    ]


def tuned_kinematics(scenario: ArmScenario, combine: Combine = "closest") -> Tuned | None:
    """Return the candidate of least cost, or ``None`` if every one leaves the path.

    Args:
        scenario: what to control.
        combine: the distance cost by which it is judged.
    """
    ocp = scenario.ocp(combine, form="velocity")
    judged = [_judged(scenario, ocp, repulsion) for repulsion in candidates(scenario)]
    kept = [candidate for candidate in judged if candidate.drift <= OFF_PATH]
    if not kept:
        return None
    best = min(kept, key=lambda candidate: candidate.cost)
    return Tuned(
        best.repulsion, best.run, best.solution, best.cost, best.drift,
        tried=len(judged), rejected=len(judged) - len(kept),
    )  # fmt: skip


def _judged(scenario: ArmScenario, ocp: OCP, repulsion: Repulsion) -> Tuned:
    program = instantaneous(scenario, repulsion).build()
    run = program.run(scenario.theta0, duration=scenario.horizon, dt=SAMPLING)
    solution = run.as_solution(ocp)
    verdict = evaluate(solution, tolerance=1e-6)
    return Tuned(repulsion, run, solution, verdict.cost, verdict.task_drift, 1, 0)
