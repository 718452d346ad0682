"""A success and the referee agree, or it is none: the costs, the ends, and between the nodes."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp.problem.constraint_rows import ConstraintRows, Violation
from ocp.problem.data_residuals import data_size
from ocp.problem.parameters import Signal
from ocp.problem.scaled import sizes_of
from ocp.referee.evaluate import Evaluation, evaluate
from ocp.referee.violation import values_along, values_at_ends
from ocp.solution.solution import Solution
from ocp.solution.status import Status

# What is this part of its nominal size counts as zero.
_ZERO = 1e-6
# Relative to the size of its row, a violation between the nodes above this is mentioned.
_MENTIONED = 1e-6
# Rounding that grows to more than this part of a state leaves nothing of an open-loop plan.
_MOST_ROUNDING = 1e-2
_ADVICE = "more intervals or a better integrator"


def judged(
    solution: Solution, accuracy: float, *, slack: float = 0.0, between_nodes: bool = True
) -> Solution:
    """Return a solution whose status agrees with the referee.

    A success becomes ``INACCURATE``, with numbers, where its own cost and the referee's differ
    by more than the accuracy, relative to the cost; where the referee does not know the cost
    that well; where an initial or terminal constraint is missed by more, relative to the size
    of its row; and, in continuous time, where the dynamics amplify rounding until no open-loop
    plan means anything.
    Where a path constraint or a state bound is violated between the nodes by more than 1e-6 of
    its row's size, the status stays and the message says so.

    Args:
        solution: of any status; only a success is judged.
        accuracy: relative; inf: nothing is compared.
        slack: by how much a terminal constraint may be missed in any case, in its own unit.
        between_nodes: whether violations between the nodes are mentioned.
    """
    if not solution.status.is_success or not np.isfinite(accuracy):
        return solution
    verdict = evaluate(solution)
    if fault := _fault(solution, verdict, accuracy, slack):
        return _saying(solution, fault).with_(status=Status.INACCURATE)
    if growth := _growth(verdict):
        status = solution.status if solution.problem.model.is_discrete else Status.INACCURATE
        return _saying(solution, growth).with_(status=status)
    if between_nodes and (found := _between_nodes(solution, verdict)):
        return _saying(solution, found)
    return solution


def _saying(solution: Solution, added: str) -> Solution:
    """Return the solution with a longer message."""
    return solution.with_(message=f"{solution.message}; {added}" if solution.message else added)


def _fault(solution: Solution, verdict: Evaluation, accuracy: float, slack: float) -> str:
    """Return what contradicts a success; empty where nothing does."""
    if not np.isfinite(verdict.cost):
        return f"integrated accurately, {verdict.worst}: {_ADVICE}"
    is_discrete = solution.problem.model.is_discrete
    fault = "" if is_discrete else _cost_fault(solution, verdict, accuracy)
    fault = fault or _end_fault(solution, verdict, accuracy, slack)
    return f"{fault}: {_advice(solution)}" if fault else ""


def _growth(verdict: Evaluation) -> str:
    """Return by how much errors grow, where that leaves nothing of an open-loop plan."""
    rounding = float(np.finfo(float).eps)
    if verdict.growth is None or rounding * verdict.growth <= _MOST_ROUNDING:
        return ""
    growth = f"{verdict.growth:.0e}".replace("e+", "e")
    return f"open loop, errors grow by {growth}: only a feedback can follow it"


def _cost_fault(solution: Solution, verdict: Evaluation, accuracy: float) -> str:
    own, cost, error = solution.cost, verdict.cost, verdict.cost_error
    most = max(abs(own - cost), error)
    size = sizes_of(solution.problem).cost + data_size(solution.problem)
    if most <= accuracy * abs(cost) or most <= accuracy * _ZERO * size:
        return ""
    if abs(own - cost) >= error:
        return f"own cost {own:.6g}, the referee's {cost:.6g}"
    return f"the referee knows the cost {cost:.6g} only to {error:.2g}"


def _end_fault(solution: Solution, verdict: Evaluation, accuracy: float, slack: float) -> str:
    truth = verdict.truth
    functions = solution.problem.functions
    for rows, values, _ in values_at_ends(solution, truth):
        if not rows.is_imposed or not (excess := rows.excess(values)[0]).any():
            continue
        place = rows.rows[0].place
        is_initial = place == "initial"
        function = functions.initial if is_initial else functions.terminal
        along = np.abs(solution.x).max(axis=0)
        if place == "instants":
            along = _sizes_of_rows(solution, rows)
        elif rows is not solution.problem.rows.start:
            along = _largest_along(solution, function)
        size = np.maximum(along, _bounds(rows))
        size = np.maximum(size, _ZERO * _sizes_of_rows(solution, rows))
        off = excess > accuracy * size + slack * (not is_initial)
        if off.any():
            i = int(np.where(off, excess, 0.0).argmax())
            return f"{rows.rows[i]} is missed by {excess[i]:.2g}"
    return ""


def _between_nodes(solution: Solution, verdict: Evaluation) -> str:
    """Return which constraint is violated between the nodes, by how much and when, if any is."""
    if verdict.violation == 0.0 or solution.problem.model.is_discrete:
        return ""
    worst = max(_mentioned(solution, verdict), key=lambda v: v.amount, default=None)
    if worst is None or worst.row is None:
        return ""
    advice = "" if worst.row.is_equation else "; BetweenNodes holds it there"
    return f"between the nodes, {worst}{advice}"


def _mentioned(solution: Solution, verdict: Evaluation) -> Iterator[Violation]:
    for rows, values, instants in values_along(solution, verdict.truth):
        found = rows.largest_violation(values, instants)
        if found.row is None:
            continue
        excess = rows.excess(values)
        size = np.maximum(np.abs(values).max(axis=0), _bounds(rows))
        size = np.where(np.isfinite(size), size, 1.0)
        exempt = excess <= _MENTIONED * np.maximum(size, _ZERO * _sizes_of_rows(solution, rows))
        yield rows.largest_violation(values, instants, exempt=exempt)


def _largest_along(solution: Solution, row: ca.Function) -> np.ndarray:
    """Return the largest magnitude of rows of (x, t, p) along a solution, (m,)."""
    p = solution.data.values.at(solution.fractions)
    values = row.map(len(solution.t))(solution.x.T, solution.t[None, :], p.T)
    return np.abs(np.array(values).T).max(axis=0)


def _sizes_of_rows(solution: Solution, rows: ConstraintRows) -> np.ndarray:
    """Return the nominal sizes of constraints, or of the states that are bounded, (m,)."""
    sizes = sizes_of(solution.problem)
    own = solution.problem.rows
    if rows is own.states or rows is own.start:
        return sizes.x
    if rows is own.rates:
        unit = 1.0 if solution.problem.model.is_discrete else solution.duration
        return sizes.u[solution.problem.control_rates.index] / unit
    return sizes.of_rows(rows)


def _bounds(rows: ConstraintRows) -> np.ndarray:
    """Return the largest finite bound of each row, in magnitude, (m,)."""
    both = np.abs(np.array([rows.box.lower, rows.box.upper]))
    return np.where(np.isfinite(both), both, 0.0).max(axis=0)


def _advice(solution: Solution) -> str:
    """Return what to do: put knots of signals on the grid, or refine it."""
    values = solution.data.values
    for entry, value in zip(values.entries, values.values, strict=True):
        knots = np.linspace(0.0, 1.0, len(value)) if isinstance(entry, Signal) else np.zeros(0)
        if (np.abs(knots[:, None] - solution.fractions).min(axis=1, initial=1.0) > 1e-9).any():
            count = len(value) - 1
            return (
                f"the knots of signal '{entry.name}' lie between the nodes: take a multiple of "
                f"{count} intervals, or {_ADVICE}"
            )
    return _ADVICE
