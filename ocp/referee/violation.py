"""By how much a trajectory violates what the problem asks, between the nodes too."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp.normal_form.peaks import largest
from ocp.problem.cache import once_per_problem
from ocp.problem.constraint import Constraint
from ocp.problem.constraint_rows import ConstraintRows, Violation, depends_on
from ocp.problem.functions import stacked
from ocp.problem.ocp import OCP
from ocp.referee.reference_trajectory import ReferenceTrajectory
from ocp.solution.control_rate import limited_rates
from ocp.solution.solution import Solution


def largest_violation(solution: Solution, truth: ReferenceTrajectory) -> Violation:
    """Return the largest violation of any bound or constraint."""
    return max(_violations(solution, truth), key=lambda violation: violation.amount)


def invariant_drift(solution: Solution, truth: ReferenceTrajectory) -> float:
    """Return the largest violation of the problem's invariants."""
    ocp = solution.problem
    if not ocp.invariants:
        return 0.0
    p = np.vstack([truth.p_start, truth.p_end[-1:]])
    along = ocp.functions.invariants.map(len(truth.t))
    values = np.array(along(truth.x.T, truth.t[None, :], p.T)).T
    return float(ocp.rows.invariants.excess(values).max(initial=0.0))


def integrals(solution: Solution, truth: ReferenceTrajectory) -> np.ndarray:
    """Return the integrals of the integral constraints over the horizon, (m,)."""
    return truth.integral(*_on_steps(solution.problem.functions.integrands, truth, truth.ends))


def peaks(solution: Solution, truth: ReferenceTrajectory) -> np.ndarray:
    """Return the largest value of each peak along the trajectory, (k,)."""
    ocp = solution.problem
    if not ocp.peaks:
        return np.empty(0)
    values = _along_steps(ocp, ocp.functions.peaks, _peaks_on_control(ocp), truth)
    return largest(ocp.peaks, np.vstack(values))


@once_per_problem
def _peaks_on_control(ocp: OCP) -> np.ndarray:
    """Return which rows of the peaks contain a control, bool (m,)."""
    return depends_on(stacked(ocp.explicit.peaks), ocp.model.u)


def _along_steps(
    ocp: OCP, function: ca.Function, on_control: np.ndarray, truth: ReferenceTrajectory
) -> tuple[np.ndarray, np.ndarray]:
    """Return rows (K, m) at the starts of the steps and at their ends.

    In discrete time a control belongs to the start of its step alone: at the ends the rows with
    one are those of the start again.
    """
    at_start, at_end = _on_steps(function, truth, truth.x[1:])
    if ocp.model.is_discrete:
        at_end[:, on_control] = at_start[:, on_control]
    return at_start, at_end


def _on_steps(
    function: ca.Function, truth: ReferenceTrajectory, after: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return a function of (x, u, t, p) at the starts of the steps, and after them, (K, m) each."""
    along = function.map(len(truth.t) - 1)
    starts = along(truth.x[:-1].T, truth.u_start.T, truth.t[None, :-1], truth.p_start.T)
    ends = along(after.T, truth.u_end.T, truth.t[None, 1:], truth.p_end.T)
    return np.array(starts).T, np.array(ends).T


def path_values(
    solution: Solution, truth: ReferenceTrajectory
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield path constraints (K, m) and times (K,), at the starts of the steps and at the ends."""
    ocp = solution.problem
    if not ocp.at("path"):
        return
    on_control = ocp.rows.path.on_control
    at_start, at_end = _along_steps(ocp, ocp.functions.path, on_control, truth)
    yield at_start, truth.t[:-1]
    yield at_end, truth.t[1:]


def values_along(
    solution: Solution, truth: ReferenceTrajectory
) -> Iterator[tuple[ConstraintRows, np.ndarray, np.ndarray]]:
    """Yield what holds at every instant: rows, their values (K, m), and the instants (K,)."""
    rows = solution.problem.rows
    yield rows.states, truth.x, truth.t
    for values, instants in path_values(solution, truth):
        yield rows.path, values, instants
    if rows.rates.is_imposed:
        yield rows.rates, *limited_rates(solution, truth.t)


def values_at_ends(
    solution: Solution, truth: ReferenceTrajectory
) -> Iterator[tuple[ConstraintRows, np.ndarray, np.ndarray]]:
    """Yield what holds at the start, and at the end: rows, their values (1, m), and when (1,)."""
    functions, rows, p = solution.problem.functions, solution.problem.rows, solution.data.values
    first = functions.initial(truth.x[0], truth.t[0], truth.p_start[0])
    last = functions.terminal(truth.x[-1], truth.t[-1], p.at(1.0)[0])
    yield rows.start, truth.x[:1], truth.t[:1]
    yield rows.initial, np.array(first).T, truth.t[:1]
    yield rows.terminal, np.array(last).T, truth.t[-1:]
    yield from _values_at_instants(solution, truth)


def _values_at_instants(
    solution: Solution, truth: ReferenceTrajectory
) -> Iterator[tuple[ConstraintRows, np.ndarray, np.ndarray]]:
    """Yield what holds at each instant: rows, their values (1, m), and when (1,)."""
    ocp, values = solution.problem, solution.data.values
    before, names = np.vstack([truth.x[:1], truth.ends]), [r.name for r in ocp.rows.instants.rows]
    for c in ocp.at("instants"):
        chosen = np.array([name == c.name for name in names])
        rows = ocp.rows.instants.where(chosen)
        for time in c.instants:
            k = int(np.abs(truth.t - truth.t[0] - time).argmin())
            p = values.at(min(1.0, time / ocp.duration))[0]
            found = np.array(ocp.functions.instants(before[k], truth.t[k], p)).T
            yield rows, found[:, chosen], truth.t[k : k + 1]


def _violations(solution: Solution, truth: ReferenceTrajectory) -> Iterator[Violation]:
    """Yield the largest violation of each group of rows."""
    ocp, rows, t = solution.problem, solution.problem.rows, truth.t
    for group, values, instants in values_along(solution, truth):
        yield group.largest_violation(values, instants)
    yield rows.controls.largest_violation(truth.u_start, t[:-1])
    yield rows.controls.largest_violation(truth.u_end, t[1:])
    for group, values, instants in values_at_ends(solution, truth):
        yield group.largest_violation(values, instants)
    if len(rows.unknowns):
        values = solution.data.values
        chosen = [
            v for e, v in zip(values.entries, values.values, strict=True) if e in ocp.unknowns
        ]
        yield rows.unknowns.largest_violation(np.concatenate(chosen)[None, :], t[:1])
    if len(rows.integral):
        yield rows.integral.largest_violation(integrals(solution, truth)[None, :], t[-1:])
    if ocp.model.nz:
        yield from _unsolved(solution, truth)
    yield Violation(
        float(ocp.time_box.excess(np.array([solution.duration]))[0]), rows.time, float(t[-1])
    )


def _unsolved(solution: Solution, truth: ReferenceTrajectory) -> Iterator[Violation]:
    """Yield by how much the algebraic equations, as they are written, are not zero."""
    rows, function = _equations(solution.problem)
    for values, instants in zip(
        _on_steps(function, truth, truth.ends), (truth.t[:-1], truth.t[1:]), strict=True
    ):
        yield rows.largest_violation(values, instants)


@once_per_problem
def _equations(ocp: OCP) -> tuple[ConstraintRows, ca.Function]:
    """Return the algebraic equations as rows, and as a function of (x, u, t, p)."""
    m = ocp.model
    zero = np.zeros(m.nz)
    written = Constraint("algebraic equations", m.algebraic, zero, zero)
    values = ocp.algebraic_solution(m.algebraic)
    function = ca.Function("equations", [m.x, m.u, m.t, ocp.p], [values])
    return ConstraintRows.of((written,), "path", m), function
