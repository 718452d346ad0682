"""By how much a trajectory violates what the problem asks, between the nodes too."""

from collections.abc import Iterator

import numpy as np

from ocp.problem.constraint import Box, Constraint
from ocp.referee.reference_trajectory import ReferenceTrajectory
from ocp.solution.solution import Solution

Violation = tuple[str, float]


def violations(solution: Solution, truth: ReferenceTrajectory) -> Iterator[Violation]:
    """Yield 'what at which time' and by how much, for every bound and constraint."""
    ocp, m = solution.problem, solution.problem.model
    yield from _outside("state", m.x_names, ocp.state_bounds, truth.x, truth.t)
    for u, t in ((truth.u_start, truth.t[:-1]), (truth.u_end, truth.t[1:])):
        yield from _outside("control", m.u_names, ocp.control_bounds, u, t)
    for values, t in path_values(solution, truth):
        yield from _worst_instants(ocp.at("path"), values, t)
    functions, p = ocp.functions, solution.data.values
    first = functions.initial(truth.x[0], truth.t[0], truth.p_start[0])
    last = functions.terminal(truth.x[-1], truth.t[-1], p.at(1.0)[0])
    yield from _worst_instants(ocp.at("initial"), np.array(first).T, truth.t[:1])
    yield from _worst_instants(ocp.at("terminal"), np.array(last).T, truth.t[-1:])
    yield "final time", float(ocp.time_box.excess(np.array([solution.duration]))[0])


def drift(solution: Solution, truth: ReferenceTrajectory) -> float:
    """Return the largest violation of the problem's invariants."""
    ocp = solution.problem
    if not ocp.invariants:
        return 0.0
    p = np.vstack([truth.p_start, truth.p_end[-1:]])
    along = ocp.functions.invariants.map(len(truth.t))
    values = np.array(along(truth.x.T, truth.t[None, :], p.T)).T
    return max(excess for _, excess in _worst_instants(ocp.invariants, values, truth.t))


def path_values(
    solution: Solution, truth: ReferenceTrajectory
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield path constraints (K, m) and times (K,), at the starts of the steps and at the ends.

    In discrete time a control belongs to the start of its step alone: at the ends its
    constraints are those of the start again.
    """
    ocp = solution.problem
    if not ocp.at("path"):
        return
    along = ocp.functions.path.map(len(truth.t) - 1)
    starts = along(truth.x[:-1].T, truth.u_start.T, truth.t[None, :-1], truth.p_start.T)
    ends = along(truth.x[1:].T, truth.u_end.T, truth.t[None, 1:], truth.p_end.T)
    at_start, at_end = np.array(starts).T, np.array(ends).T
    if ocp.model.is_discrete:
        on_control = ocp.functions.path_on_control
        at_end[:, on_control] = at_start[:, on_control]
    yield at_start, truth.t[:-1]
    yield at_end, truth.t[1:]


def _outside(
    kind: str, names: tuple[str, ...], box: Box, values: np.ndarray, t: np.ndarray
) -> Iterator[Violation]:
    excess = box.excess(values)
    for i, name in enumerate(names):
        k = int(excess[:, i].argmax())
        yield f"{kind} {name} at t = {t[k]:.4g} s", float(excess[k, i])


def _worst_instants(
    constraints: tuple[Constraint, ...], values: np.ndarray, t: np.ndarray
) -> Iterator[Violation]:
    """Yield the worst instant of each constraint from their stacked values (K, m)."""
    first = 0
    for c in constraints:
        excess = c.box.excess(values[:, first : first + c.size]).max(axis=1, initial=0.0)
        first += c.size
        k = int(excess.argmax())
        if c.at == "path":
            yield f"constraint '{c.name}' at t = {t[k]:.4g} s", float(excess[k])
        else:
            yield f"{c.at} constraint '{c.name}'", float(excess[k])
