"""A solution of phases side by side, as a solution of each phase on its own clock."""

from collections.abc import Iterator

import numpy as np

from ocp.method.in_normal_form import InNormalForm
from ocp.phases.side_by_side import START_TIME, Lane, SideBySide
from ocp.referee.evaluate import evaluate
from ocp.solution.solution import Solution


def phase_solutions(side: SideBySide, whole: Solution) -> tuple[Solution, ...]:
    """Return the solution of each phase, in its own terms and times; its cost is the referee's."""
    each = on_own_clocks(side, whole)
    return tuple(found.with_(cost=evaluate(found).cost) for found in each)


def begun(side: SideBySide, whole: Solution) -> np.ndarray:
    """Return when each phase starts, and when the last one ends [s]."""
    durations = side.durations(whole.unknowns)
    return float(whole.parameters[START_TIME][0]) + np.append(0.0, np.cumsum(durations))


def on_own_clocks(side: SideBySide, whole: Solution) -> Iterator[Solution]:
    """Yield the solution of each phase, without its cost."""
    times, linked = begun(side, whole), side.chain.start_is_linked
    for i, lane in enumerate(side.lanes):
        t = times[i] + whole.fractions * (times[i + 1] - times[i])
        yield _of(side, lane, whole, t, linked[i])


def _of(
    side: SideBySide, lane: Lane, whole: Solution, t: np.ndarray, linked: np.ndarray
) -> Solution:
    known = {entry.name for entry in lane.base.parameters}  # the last input is a state there
    values = side.values(lane, {**whole.parameters, **whole.unknowns}).as_dict()
    x, x0 = whole.x[:, lane.x], whole.x0[lane.x].copy()
    x0[: len(linked)] = np.where(linked, x[0, : len(linked)], x0[: len(linked)])
    found = whole.with_(
        problem=lane.base,
        message="",
        t=t,
        x=x,
        x0=x0,
        costate=whole.costate[:, lane.x],
        u=whole.u[:, lane.u],
        cost=0.0,  # no method knows the share of a phase
        history={},
        parameters={name: value for name, value in values.items() if name in known},
        unknowns={},
        normal=None,
    )
    return found if lane.form is None else InNormalForm(lane.form).answer(found)
