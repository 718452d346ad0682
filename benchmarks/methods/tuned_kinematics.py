"""The instantaneous controller of an arm scenario, with gains found by a small search.

A comparison with a badly tuned controller says nothing. So each scenario gets the best of a
fixed search over the three parameters of the repulsion. First a grid of 80,

* v0 = 0.02, 0.05, 0.1, 0.2, 0.4 m/s,
* d_m = 0.4, 0.6, 0.8, 1.0 times the distance of influence of the scenario's cost,
* d_i = 1.2, 1.6, 2.4, 3.2 times d_m,

then five rounds around the best so far: its 26 neighbours in the logarithms of v0, d_m and
d_i / d_m - 1, at first a factor of 2, 1.25 and 2 away, half as far (in the logarithm) in each
further round. That is 210 candidates, and no random number.

A candidate counts if its end effector stays within 5 mm of the path. K = 20 / s, damping only
near singularities (``Filtered``). In the search velocities are held for 10 ms; what is returned
is held for 2 ms and judged by the referee.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from time import perf_counter

import casadi as ca
import numpy as np

from benchmarks.methods.many_kinematics import ManyKinematics
from models import ArmScenario, Combine, link_distances
from ocp import OCP, Evaluation, Solution, evaluate
from solvers import KinematicRun, PrioritisedKinematics, Repulsion, repel, track

SPEEDS = (0.02, 0.05, 0.1, 0.2, 0.4)
BEGIN = (0.4, 0.6, 0.8, 1.0)
HOMOGENEOUS = (1.2, 1.6, 2.4, 3.2)
ROUNDS = 5
# How far the first round's neighbours are: factors of v0, d_m and d_i / d_m - 1.
FACTORS = (2.0, 1.25, 2.0)
SEARCH_SAMPLING = 0.01  # [s]
SAMPLING = 0.002  # [s]
FEEDBACK = 20.0  # [1/s]
OFF_PATH = 5e-3  # [m]


@dataclass(frozen=True, eq=False)
class Tuned:
    """The best candidate.

    Attributes:
        repulsion: its parameters.
        run: its motion.
        solution: the same, for the referee.
        verdict: the referee's.
        cost: the referee's, of the problem in velocity form.
        drift: largest distance of the end effector from its path [m].
        tried: number of candidates.
        rejected: how many of them left the path.
    """

    repulsion: Repulsion
    run: KinematicRun
    solution: Solution
    verdict: Evaluation
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
    """Return the grid with which the search begins."""
    grid = product(SPEEDS, BEGIN, HOMOGENEOUS)
    return [
        Repulsion(v0, begin * scenario.influence, wide * begin * scenario.influence)
        for v0, begin, wide in grid
    ]


def tuned_kinematics(scenario: ArmScenario, combine: Combine = "closest") -> Tuned:
    """Return the candidate of least cost; if every one leaves the path, the one that does least.

    Args:
        scenario: what to control.
        combine: the distance cost by which it is judged.
    """
    ocp = scenario.ocp(combine, form="velocity")
    tried = _searched(scenario, ocp)
    best = min(tried, key=_order)
    started = perf_counter()
    program = instantaneous(scenario, best.repulsion).build()
    run = program.run(scenario.theta0, duration=scenario.horizon, dt=SAMPLING)
    solution = run.as_solution(ocp).with_(solve_time=perf_counter() - started)
    verdict = evaluate(solution, tolerance=1e-6)
    rejected = sum(candidate.drift > OFF_PATH for candidate in tried)
    return Tuned(
        best.repulsion, run, solution, verdict, verdict.cost, verdict.task_drift,
        tried=len(tried), rejected=rejected,
    )  # fmt: skip


@dataclass(frozen=True)
class _Candidate:
    repulsion: Repulsion
    cost: float
    drift: float


def _order(candidate: _Candidate) -> tuple[float, float]:
    """What is better comes first: on the path by its cost, off it by how far."""
    return max(candidate.drift, OFF_PATH), candidate.cost


def _searched(scenario: ArmScenario, ocp: OCP) -> list[_Candidate]:
    """Return every candidate of the search with what it costs at the coarse sampling."""
    grid = candidates(scenario)
    many = ManyKinematics.of(scenario, ocp, instantaneous(scenario, grid[0]))
    tried = _judged(many, grid)
    for reach in range(ROUNDS):
        best = min(tried, key=_order)
        tried += _judged(many, _neighbours(best.repulsion, 0.5**reach))
    return tried


def _judged(many: ManyKinematics, repulsions: Sequence[Repulsion]) -> list[_Candidate]:
    costs, drifts = many.judged(
        np.array([[r.v0, r.d_m, r.d_i] for r in repulsions]), SEARCH_SAMPLING
    )
    return [
        _Candidate(r, float(cost), float(drift))
        for r, cost, drift in zip(repulsions, costs, drifts, strict=True)
    ]


def _neighbours(centre: Repulsion, reach: float) -> list[Repulsion]:
    """Return the 26 around it, ``reach`` times the logarithm of the factors away."""
    found = []
    for signs in product((-1, 0, 1), repeat=3):
        if any(signs):
            v, d, w = (f ** (reach * sign) for f, sign in zip(FACTORS, signs, strict=True))
            d_m = centre.d_m * d
            found.append(Repulsion(centre.v0 * v, d_m, d_m + w * d * (centre.d_i - centre.d_m)))
    return found
