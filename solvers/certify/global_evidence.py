"""Is the local optimum the global one? A proof where the problem is convex, else evidence."""

from ocp import (
    OCP,
    ProblemError,
    Signal,
    UnsupportedProblem,
    discretise,
    evaluate,
    linear_quadratic,
)
from solvers.certify.certificate import Check, Estimate, Verdict
from solvers.direct.multiple_shooting import MultipleShooting
from solvers.indirect.enumerate_extremals import enumerate_extremals
from solvers.multistart import multistart

CONVEXITY, STARTS, EXTREMALS = "convexity", "other starts", "enumerated extremals"
# A trajectory is cheaper only if it is so by more than the grids differ, relative to 1 + cost.
_CHEAPER = 1e-3
# For convexity a grid is enough that shows every matrix; more, where they change with time.
_STEPS = 20
# Of the extremals of a scan the cheapest are made exact.
_ROOTS = 12


def convexity(ocp: OCP) -> Check:
    """Say whether every local optimum is the global one, since the problem is convex.

    Linear dynamics and constraints with a convex quadratic cost, sampled with zero-order hold.
    """
    try:
        if not ocp.model.is_discrete and not ocp.has_free_time:
            ocp = discretise(ocp, ocp.duration / _STEPS)
        linear_quadratic(ocp)
    except (UnsupportedProblem, ProblemError) as reason:
        return Check.skipped(CONVEXITY, f"a local optimum need not be the global one: {reason}")
    said = "linear dynamics, convex quadratic cost: the local optimum is the global one"
    return Check(CONVEXITY, Verdict.HOLDS, said)


def other_starts(best: Estimate, starts: int, seed: int, intervals: int) -> Check:
    """Solve from random controls and fail if any answer is cheaper than the certified one."""
    ocp = best.solution.problem
    if starts < 2:
        return Check.skipped(STARTS, "one start only")
    found = multistart(ocp, MultipleShooting(intervals), starts, seed)
    if not found:
        return Check.skipped(STARTS, f"none of {starts} starts led to a feasible optimum")
    lead = (best.cost - found[0].cost) / (1.0 + abs(best.cost))
    costs = ", ".join(f"{optimum.cost:.6g} ({optimum.found}x)" for optimum in found[:4])
    said = f"{starts} starts, {len(found)} distinct optima: {costs}; evidence, no proof"
    return Check.at_most(STARTS, lead, _CHEAPER, said)


def every_extremal(best: Estimate) -> Check:
    """Enumerate the extremals of a problem with one redundant degree of freedom."""
    ocp = best.solution.problem
    if not ocp.invariants:
        return Check.skipped(EXTREMALS, "the problem keeps no manifold to scan")
    signals = [entry.name for entry in ocp.parameters if isinstance(entry, Signal)]
    if signals:
        return Check.skipped(EXTREMALS, f"signal '{signals[0]}' is not scanned")
    try:
        found = enumerate_extremals(ocp, keep=_ROOTS)
    except UnsupportedProblem as reason:
        return Check.skipped(EXTREMALS, str(reason))
    if not found.solutions:
        return Check.skipped(EXTREMALS, "the scan found none")
    cheapest = evaluate(found.solutions[0]).cost
    lead = (best.cost - cheapest) / (1.0 + abs(best.cost))
    said = (
        f"the cheapest of {len(found.solutions)} costs {cheapest:.10g}; the scan is no proof: "
        f"{found.unresolved} places unresolved, {found.lost} roots lost"
    )
    return Check.at_most(EXTREMALS, lead, 1e-7, said)
