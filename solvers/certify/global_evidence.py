"""Whether a local optimum is the global one: a proof where the problem is convex, else evidence."""

from dataclasses import replace

import casadi as ca
import numpy as np

from ocp import (
    OCP,
    ProblemError,
    Solution,
    UnsupportedProblem,
    discretise,
    evaluate,
    linear_quadratic,
    solve,
)
from ocp.internal import RunData, cut
from solvers.certify.certificate import CONVEXITY, STARTS, Check, Estimate, Verdict
from solvers.collocation.collocation import Collocation
from solvers.direct.multiple_shooting import MultipleShooting
from solvers.indirect.reverse.enumerate_extremals import enumerate_extremals
from solvers.multistart import multistart

EXTREMALS = "enumerated extremals"
# A trajectory is cheaper only if it is so by more than the grids differ, relative to 1 + cost.
_CHEAPER = 1e-3
# What held controls may violate between the nodes of a grid, and where none does as little:
# they cannot follow a constraint on state and control; and how much finer the grid is that a
# cheaper answer has to stand on.
_BETWEEN, _LOOSE, _FINER = 1e-2, 0.1, 4
# For convexity a grid is enough that shows every matrix; more, where they change with time.
_STEPS = 20
# An eigenvalue this much below zero, relative to the largest one, is rounding.
_ROUNDING = 1e-10
# Of the extremals of a scan the cheapest are made exact.
_ROOTS = 12
# Costs of one extremal differ by less, relative to 1 + cost.
_SAME_COST = 1e-7


def other_data(solution: Solution) -> str:
    """Say which number of a run is not the problem's own, which is all that is searched here."""
    ocp, own, run = solution.problem, RunData.of(solution.problem), solution.data
    given = ~ocp.start_is_free
    if not np.array_equal(own.x0[given], run.x0[given]):
        return f"the start {run.x0} is not that of the problem, {own.x0}"
    if own.t0 != run.t0:
        return f"t0 = {run.t0:g} s is not that of the problem, {own.t0:g} s"
    declared = own.values.as_dict()
    for name, value in run.values.as_dict().items():
        if not np.array_equal(value, declared[name]):
            return f"parameter '{name}' is not as the problem declares it"
    return ""


def convexity(ocp: OCP) -> Check:
    """Say whether every local optimum is the global one, since the problem is convex.

    Linear dynamics and constraints with a convex quadratic cost, sampled with zero-order hold.
    In continuous time the running cost has to be convex itself: what is sampled may be so where
    controls that change faster than the samples are not.
    """
    if ocp.has_free_time:
        return Check.skipped(
            CONVEXITY,
            "a local optimum need not be the global one: the final time is free, and multiplies "
            "the dynamics",
        )
    try:
        if not ocp.model.is_discrete:
            sampled = discretise(ocp, ocp.duration / _STEPS)
            least = _least_weight(ocp)
            if least < -_ROUNDING:
                return Check.skipped(
                    CONVEXITY, f"the running cost is concave somewhere: eigenvalue {least:.1e}"
                )
            ocp = sampled
        linear_quadratic(ocp)
    except (UnsupportedProblem, ProblemError) as reason:
        return Check.skipped(CONVEXITY, f"a local optimum need not be the global one: {reason}")
    said = "linear dynamics, convex quadratic cost: the local optimum is the global one"
    return Check(CONVEXITY, Verdict.HOLDS, said)


def _least_weight(ocp: OCP) -> float:
    """The least eigenvalue of a quadratic running cost, relative to the largest one."""
    z = ca.vertcat(ocp.model.x, ocp.model.u)
    weights = ca.hessian(ca.SX(ocp.running_cost), z)[0]
    values = np.linalg.eigvalsh(np.array(ca.evalf(ca.densify(weights))))
    return float(values[0] / max(np.abs(values).max(), np.finfo(float).tiny))


def other_starts(
    best: Estimate, starts: int, seed: int, solver: MultipleShooting | Collocation
) -> Check:
    """Solve from random controls and fail if any answer is cheaper than the certified one."""
    ocp = best.solution.problem
    if starts < 2:
        return Check.skipped(STARTS, "one start only")
    found = multistart(ocp, solver, starts, seed, violation=_BETWEEN)
    if not found:
        found = multistart(ocp, solver, starts, seed, violation=_LOOSE)
    if not found:
        return Check.skipped(STARTS, f"none of {starts} starts led to a feasible optimum")
    cheapest = found[0].cost
    if _lead(best, cheapest) > _CHEAPER:  # by what the coarse grid violates, perhaps
        finer = replace(solver, intervals=cut(solver.intervals, _FINER))
        cheapest = evaluate(solve(ocp, finer, guess=found[0].solution)).cost
    lead = _lead(best, cheapest)
    costs = ", ".join(f"{optimum.cost:.6g} ({optimum.found}x)" for optimum in found[:4])
    said = f"{starts} starts, {len(found)} distinct optima: {costs}; evidence, no proof"
    said += _of_another(lead > _CHEAPER, cheapest)
    return Check.at_most(STARTS, lead, _CHEAPER, said)


def _lead(best: Estimate, cost: float) -> float:
    """By how much another cost is lower, relative to 1 + the certified one."""
    return (best.cost - cost) / (1.0 + abs(best.cost))


def _of_another(is_cheaper: bool, cost: float) -> str:
    """Return whose cost it is, where it is lower than the certified one."""
    if not is_cheaper:
        return ""
    return f"; {cost:.10g} is the cost of ANOTHER solution than the one certified here"


def every_extremal(best: Estimate) -> Check:
    """Enumerate the extremals of a problem with one redundant degree of freedom."""
    ocp = best.solution.problem
    if not ocp.invariants:
        return Check.skipped(EXTREMALS, "the problem keeps no manifold to scan")
    signals = [entry.name for entry in ocp.moving]
    if signals:
        return Check.skipped(EXTREMALS, f"signal '{signals[0]}' is not scanned")
    try:
        found = enumerate_extremals(ocp, keep=_ROOTS)
    except UnsupportedProblem as reason:
        return Check.skipped(EXTREMALS, str(reason))
    if not found.solutions:
        return Check.skipped(EXTREMALS, "the scan found none")
    cheapest = evaluate(found.solutions[0]).cost
    lead = _lead(best, cheapest)
    said = (
        f"the cheapest of {len(found.solutions)} costs {cheapest:.10g}; the scan is no proof: "
        f"{found.unresolved} places unresolved, {found.lost} roots lost"
    ) + _of_another(lead > _SAME_COST, cheapest)
    return Check.at_most(EXTREMALS, lead, _SAME_COST, said)
