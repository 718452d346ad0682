"""The optimal value by independent methods, each with its own error estimate."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ocp import OCP, Box, Solution, Status, UnsupportedProblem, evaluate
from ocp.internal import instant_fractions
from solvers.certify.certificate import Estimate
from solvers.certify.local_error import PARTS, local_error
from solvers.collocation.collocation import Collocation
from solvers.collocation.collocation_points import Family
from solvers.collocation.refine_mesh import refine_mesh
from solvers.direct.multiple_shooting import MultipleShooting
from solvers.polish import polish

# The referee integrates to this, relative.
TOLERANCE = 1e-11
# What a polished extremal of the problem without its path constraints may violate of them.
_INACTIVE = 1e-8
# Relative change of the cost at which its steps are fine enough; where the second derivatives
# of the problem jump (smoothness 1), an integrator gains little by more.
_POLISHED, _POLISHED_ROUGH = 1e-10, 1e-9
# Ratios of successive differences between which extrapolation is believed: orders 0.6 to 4.3.
_LEAST_RATIO, _MOST_RATIO = 1.5, 20.0
_GRIDS = 4
# Orders that smoothness explains, and how closely the last two ratios have to show one.
_SMOOTH_ORDERS, _CLOSE = (2.0, 4.0), 0.15
# Of so many differences the largest is the error: where the order is none that smoothness
# explains, and where there is no order at all.
_DOUBTFUL, _ERRATIC = 2, 3
# Odd, for the reason of PARTS.
_INTERVALS = 9
# Collocation: of the interior-point method; of the dynamics between the points; of the mesh.
BARRIER, _DEFECT, _ROUNDS = 1e-10, 1e-9, 10
# A cost that changes by less from mesh to mesh, relative, is at its limit.
_SETTLED = 1e-11
# Refinement that ends above its accuracy leaves the rest to ``local_error``.
_LEFT = 1e-6
_MOST_INTERVALS = 1000


class NoEstimateError(Exception):
    """A method gives no value for this problem; the message says why."""


class ExtrapolatedCost(NamedTuple):
    """The limit of costs on finer and finer grids, its error, and how it was found."""

    cost: float
    error: float
    sentence: str


def by_polish(solution: Solution) -> Estimate:
    """Return the value of indirect multiple shooting, steps doubled until the cost holds still.

    Path constraints and state bounds are left out; the extremal counts where the referee finds
    that it keeps them all the same.

    Raises:
        NoEstimateError: where the minimum principle does not apply, Newton fails, or a path
            constraint is active.
    """
    ocp = solution.problem
    try:
        accuracy = _POLISHED if ocp.smoothness > 1 else _POLISHED_ROUGH
        polished = polish(solution.with_(problem=_without_path(ocp)), accuracy=accuracy)
    except UnsupportedProblem as reason:
        raise NoEstimateError(str(reason)) from None
    if not polished.status.is_success:
        raise NoEstimateError(f"{polished.status.value}. {polished.message}")
    polished = polished.with_(problem=ocp)
    verdict = evaluate(polished, tolerance=TOLERANCE)
    if verdict.violation > _INACTIVE:
        raise NoEstimateError(f"{verdict.worst} is violated by {verdict.violation:.1e} without it")
    apart = abs(verdict.cost - polished.cost)
    error = max(apart, verdict.cost_error, polished.residual, accuracy * (1.0 + abs(verdict.cost)))
    said = f"the referee's cost differs by {apart:.1e}"
    return Estimate(
        method=f"indirect multiple shooting, residual {polished.residual:.1e}",
        cost=verdict.cost,
        error=error,
        violation=verdict.violation,
        solution=polished,
        sentence=said,
    )


def by_collocation(coarse: Solution, points: Family = "radau") -> Estimate:
    """Return the value of collocation on a mesh refined for the dynamics, then for kinks.

    The error is the last change of the referee's cost, and what an interior-point method leaves
    between its iterates and active bounds.

    Args:
        coarse: where the first mesh starts.
        points: on each interval.

    Raises:
        NoEstimateError: if no mesh is solved.
    """
    first = max(_INTERVALS, len(instant_fractions(coarse.problem)) + 1)
    solver = Collocation(intervals=first, points=points, tolerance=BARRIER)
    try:
        found = refine_mesh(coarse, solver=solver, accuracy=_DEFECT)
    except UnsupportedProblem as reason:
        raise NoEstimateError(str(reason)) from None
    answer = found.solution
    nearly = answer.status is Status.INACCURATE and found.rounds[-1].error <= _LEFT
    if not (answer.status.is_success or nearly):
        raise NoEstimateError(f"collocation: {answer.status.value}. {answer.message}")
    verdict, change = evaluate(answer, tolerance=TOLERANCE), np.inf
    barrier, bias = BARRIER if _has_inequalities(coarse.problem) else 0.0, 0.0
    for finer in local_error(answer, found.rounds[-1].mesh.cut(PARTS), _ROUNDS, solver):
        before, answer = verdict.cost, finer
        verdict = evaluate(answer, tolerance=TOLERANCE)
        change, bias = abs(verdict.cost - before), barrier * len(answer.t)
        if change <= max(bias, _SETTLED) * (1.0 + abs(verdict.cost)):
            break
    if not np.isfinite(change):
        raise NoEstimateError("collocation: the finer mesh is not solved")
    pieces = len(answer.breaks) - 1
    return Estimate(
        method=f"{points.capitalize()} collocation, {pieces} intervals",
        cost=verdict.cost,
        error=max(change, bias, verdict.cost_error, TOLERANCE * (1.0 + abs(verdict.cost))),
        violation=verdict.violation,
        solution=answer,
        sentence=f"the last finer mesh changed the cost by {change:.1e}",
    )


def by_shooting(coarse: Solution) -> Estimate:
    """Return the value of direct multiple shooting, extrapolated over doubled grids.

    Where successive differences of the cost shrink by a steady ratio, Richardson's extrapolation
    is taken; where not, the finest cost. See ``extrapolated`` for the error.

    Args:
        coarse: the direct answer on the coarsest grid.

    Raises:
        NoEstimateError: if a grid is not solved.
    """
    answer = coarse
    verdicts = [evaluate(answer, tolerance=TOLERANCE)]
    while len(verdicts) < _GRIDS or (
        not is_steady([v.cost for v in verdicts]) and 2 * (len(answer.t) - 1) <= _MOST_INTERVALS
    ):
        answer = _solved(MultipleShooting(2 * (len(answer.t) - 1)), answer)
        verdicts.append(evaluate(answer, tolerance=TOLERANCE))
    limit = extrapolated(np.array([v.cost for v in verdicts]))
    barrier = MultipleShooting().tolerance if _has_inequalities(coarse.problem) else 0.0
    return Estimate(
        method=f"direct multiple shooting, {len(answer.t) - 1} intervals",
        cost=limit.cost,
        error=max(limit.error, barrier * len(answer.t), verdicts[-1].cost_error),
        violation=verdicts[-1].violation,
        solution=answer,
        sentence=limit.sentence,
    )


def on_grid(solution: Solution, intervals: int) -> Solution:
    """Return the direct answer on a grid, doubled until the integrator follows the states.

    Raises:
        NoEstimateError: if that does not come to an end, or a grid is not solved.
    """
    while True:
        try:
            return _solved(MultipleShooting(intervals, tolerance=BARRIER), solution)
        except NoEstimateError:
            intervals *= 2
            if intervals > _MOST_INTERVALS:
                raise


def on_points(solution: Solution, intervals: int) -> Solution:
    """Return the answer of collocation, which is implicit.

    Raises:
        NoEstimateError: if it is not solved.
    """
    return _solved(Collocation(intervals, tolerance=BARRIER), solution)


def extrapolated(costs: np.ndarray) -> ExtrapolatedCost:
    """Return the limit of costs on grids doubled each time, its error, and how it was found.

    Richardson's extrapolation assumes one power of the step. Where the last two ratios of
    differences both show the order of a smooth problem, 2 or 4, its error is its change from the
    grids before. Where a control jumps between the nodes, the error depends on where in its
    interval it jumps: differences may shrink steadily for a while, but no power is behind it, and
    the error is all that was extrapolated, and the larger one of the last two differences at
    least. Where differences do not even shrink steadily, it is the largest of the last three.

    Args:
        costs: (at least 4,), coarsest first.
    """
    steps, last = np.diff(costs), float(costs[-1])
    if not is_steady(costs):
        change = float(np.abs(steps[-_ERRATIC:]).max())
        return ExtrapolatedCost(
            last, change, "the largest change of the last three doublings; no steady order"
        )
    ratios = steps[:-1] / steps[1:]
    limits = costs[2:] + steps[1:] / (ratios - 1.0)
    limit, orders = float(limits[-1]), np.log2(ratios)
    error, said = abs(float(limits[-1] - limits[-2])), f"the observed order {orders[-1]:.2f}"
    if any((np.abs(orders[-2:] - order) <= _CLOSE).all() for order in _SMOOTH_ORDERS):
        return ExtrapolatedCost(limit, error, f"extrapolated with {said}")
    error = max(error, abs(limit - last), float(np.abs(steps[-_DOUBTFUL:]).max()))
    said = f"extrapolated with {said}, which is no power: all of it is in doubt"
    return ExtrapolatedCost(limit, error, said)


def is_steady(costs: Sequence[float] | np.ndarray) -> bool:
    """Whether the last three changes of the cost shrink by ratios that an order explains."""
    steps = np.diff(costs)[-3:]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = steps[:-1] / steps[1:]
    return bool(((ratios >= _LEAST_RATIO) & (ratios <= _MOST_RATIO)).all())


def _solved(solver: MultipleShooting | Collocation, guess: Solution) -> Solution:
    data = guess.data
    program = solver.build(guess.problem)
    answer = program.run(x0=data.x0, t0=data.t0, parameters=guess.parameters, guess=guess)
    if not answer.status.is_success:
        raise NoEstimateError(
            f"{type(solver).__name__}, {solver.intervals} intervals: {answer.status.value}. "
            f"{answer.message}"
        )
    return answer


def _has_inequalities(ocp: OCP) -> bool:
    bounded = ocp.control_bounds.is_active or ocp.state_bounds.is_active or ocp.has_free_time
    return bounded or not all(c.is_equation for c in ocp.constraints)


def _without_path(ocp: OCP) -> OCP:
    """Return the problem without path constraints and state bounds."""
    kept = tuple(c for c in ocp.constraints if c.at != "path")
    if len(kept) == len(ocp.constraints) and not ocp.state_bounds.is_active:
        return ocp
    return replace(ocp, constraints=kept, state_bounds=Box())
