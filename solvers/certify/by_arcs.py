"""The optimal value by shooting over the arcs of a trajectory, with its switches as unknowns."""

from dataclasses import replace

import numpy as np

from ocp import ProblemError, Solution, evaluate
from solvers.certify.arc_conditions import ArcConditions
from solvers.certify.arc_shooting import ArcShooting
from solvers.certify.certificate import Estimate
from solvers.certify.control_arcs import Arc, NoArcsError, arcs_of
from solvers.certify.estimates import BARRIER, TOLERANCE, NoEstimateError, extrapolated
from solvers.certify.time_scaled_problem import TimeScaledProblem
from solvers.direct.multiple_shooting import MultipleShooting

# Of the equations of indirect shooting; and of the cost from step to half the step, relative.
_RESIDUAL, _SETTLED = 1e-10, 1e-10
_STEPS, _MOST_STEPS = 32, 512
# What a trajectory on arcs may violate: more, and the arcs are not those of the problem.
_VIOLATION = 1e-6
# Of a multiplier's wrong sign, see ``ArcShooting.wrong_signs``.
_SIGN = 1e-6
# Intervals on each arc of the direct method, coarsest first.
_INTERVALS = (10, 20, 40, 80)
# Chattering has no end: more arcs are not looked at.
_MOST_ARCS = 12


def by_arcs(answer: Solution) -> Estimate:
    """Return the value of shooting over the arcs of an answer: indirect, or else direct.

    The answer says which arcs there are and where the iteration starts, and nothing else:
    switching times, states and costates are found anew. Where the minimum principle gives no
    equation for the control on an arc, since it is singular there, the durations of the arcs and
    held controls are optimised by direct multiple shooting.

    Args:
        answer: of collocation.

    Raises:
        NoEstimateError: where no control is at a bound on any arc, or neither works.
    """
    arcs = arcs_of(answer)
    if not any(law for arc in arcs for law in arc.laws):
        raise NoEstimateError("no control is at a bound for long")
    if len(arcs) > _MOST_ARCS:
        raise NoEstimateError(f"{len(arcs)} arcs: no more than {_MOST_ARCS} are looked at")
    try:
        return _indirect(answer, arcs)
    except NoArcsError as reason:
        try:
            return _direct(answer, arcs)
        except NoArcsError as other:
            raise NoEstimateError(f"indirect: {reason}; direct: {other}") from None


def _indirect(answer: Solution, arcs: tuple[Arc, ...]) -> Estimate:
    """Newton on the minimum principle, steps halved until the referee's cost holds still."""
    shooting = ArcShooting(ArcConditions.of(answer, arcs), steps=_STEPS)
    w, before, change = shooting.guess(), np.inf, np.inf
    while True:
        found = shooting.solve(w, _RESIDUAL)
        if not found.converged:
            raise NoArcsError(f"Newton ends at a residual of {found.residual:.1e}")
        w = found.x
        try:
            trajectory = shooting.trajectory(w)
        except ProblemError as reason:
            raise NoArcsError(str(reason)) from None
        verdict = evaluate(trajectory, tolerance=TOLERANCE)
        change, before = abs(verdict.cost - before), verdict.cost
        small = _SETTLED * (1.0 + abs(verdict.cost))
        if change <= small or 2 * shooting.steps > _MOST_STEPS:
            break
        shooting = replace(shooting, steps=2 * shooting.steps)
    if not verdict.violation <= _VIOLATION:
        raise NoArcsError(f"{verdict.worst} is violated by {verdict.violation:.1e}")
    wrong = shooting.wrong_signs(trajectory)
    if not wrong <= _SIGN:
        raise NoArcsError(f"a multiplier has the wrong sign, by {wrong:.1e}")
    return Estimate(
        method=f"indirect shooting on {len(arcs)} arcs, residual {found.residual:.1e}",
        cost=verdict.cost,
        error=max(change, small, verdict.cost_error),
        violation=verdict.violation,
        solution=trajectory.with_(cost=verdict.cost, residual=found.residual),
        sentence=f"half the step changed the cost by {change:.1e}; multipliers have their signs",
    )


def _direct(answer: Solution, arcs: tuple[Arc, ...]) -> Estimate:
    """Durations and held controls by multiple shooting, on grids doubled on every arc."""
    scaled, verdicts = TimeScaledProblem(answer, arcs), []
    ocp, found = scaled.ocp, None
    for intervals in _INTERVALS:
        program = MultipleShooting(intervals * len(arcs), tolerance=BARRIER).build(ocp)
        found = program.run(parameters=answer.parameters, guess=found or scaled.guess)
        if not found.status.is_success:
            raise NoArcsError(f"{found.status.value}. {found.message}")
        verdicts.append(evaluate(found, tolerance=TOLERANCE))
    assert found is not None
    if not verdicts[-1].violation <= _VIOLATION:
        raise NoArcsError(f"{verdicts[-1].worst} is violated by {verdicts[-1].violation:.1e}")
    limit = extrapolated(np.array([v.cost for v in verdicts]))
    return Estimate(
        method=f"direct multiple shooting on {len(arcs)} arcs, {len(found.t) - 1} intervals",
        cost=limit.cost,
        error=max(limit.error, BARRIER * len(found.t), verdicts[-1].cost_error),
        violation=verdicts[-1].violation,
        solution=scaled.trajectory(found),
        sentence=limit.sentence,
    )
