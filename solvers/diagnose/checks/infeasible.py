"""No trajectory: which demands exclude each other, by how much, and whether time would help."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ocp import OCP, FreeTime, Solution, evaluate, solve
from solvers.diagnose.cause import Cause
from solvers.diagnose.elastic_program import Demand, ElasticProgram, ElasticSolution
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.subject import DiagnosedProblem
from solvers.diagnose.trajectory import along
from solvers.direct.multiple_shooting import MultipleShooting

# How much longer the horizon may become when the shortest time is estimated.
_LONGER = 50.0
# Accepted violation between the nodes of such an estimate.
_BETWEEN = 0.1
_MULTIPLES = (2, 4, 8)


def infeasible(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Where the trial failed, relax everything, then find the fewest demands in conflict."""
    if subject.trial.status.is_success or not _asks(subject):
        return
    # A coarse grid is quick, but may jump over what a finer one cannot.
    for on in dict.fromkeys((subject.coarse, subject)):
        found = _with_more_time(on, subject.trial)
        if found is not None:
            yield found
            return


def _with_more_time(subject: DiagnosedProblem, trial: Solution) -> Finding | None:
    """Return what is in conflict on this grid; None if everything can be met."""
    elastic, nodes = along(subject)
    tr, p = subject.program.transcription, subject.program.transcription.data_vector(subject.data)
    guesses = [
        tr.join(*subject.program.first_iterate(subject.data, start))
        for start in (subject.ocp.guess, trial)
    ]
    answers = [elastic.solve(w0, p, range(len(elastic.demands))) for w0 in guesses]
    answers = [a for a in answers if a.found]
    if not answers or any(elastic.is_possible(a) for a in answers):
        return None
    answer = min(answers, key=lambda a: elastic.excess(a).sum())
    members = elastic.conflict(answer, p)
    shortest = _shortest(subject) if _time_may_help(subject, elastic, members) else None
    duration = trial.duration
    return _finding(subject, elastic, answer, members, nodes, p, shortest, duration)


def _asks(subject: DiagnosedProblem) -> bool:
    ocp = subject.ocp
    return bool(ocp.constraints) or ocp.state_bounds.is_active


def _time_may_help(
    subject: DiagnosedProblem, elastic: ElasticProgram, members: tuple[int, ...]
) -> bool:
    """Where an end takes part: what stands in its way may be a control, or a speed limit.

    A signal is given over the horizon as it is, and so are data.
    """
    written = subject.written
    if written.moving or written.data:
        return False
    ends = {c.name for c in subject.ocp.at("terminal")}
    return any(ends & set(elastic.demands[i].where) for i in members)


def _shortest(subject: DiagnosedProblem) -> float | None:
    """Return a duration with which a trajectory exists [s], None if none was found.

    The shortest one where that can be computed, else the first of a few multiples.
    """
    ocp, d = subject.ocp, subject.ocp.duration
    if not ocp.model.is_discrete:
        longer = FreeTime(guess=3 * d, lower=d, upper=_LONGER * d)
        quick = replace(ocp, horizon=longer, running_cost=1.0, terminal_cost=0.0)
        found = _feasible(quick, subject.solver)
        if found is not None or ocp.has_free_time:
            return found
    for factor in _MULTIPLES:
        found = _feasible(replace(ocp, horizon=factor * (ocp.steps or d)), subject.solver)
        if found is not None:
            return found
    return None


def _feasible(ocp: OCP, solver: MultipleShooting) -> float | None:
    """Return the duration of a solution that the referee accepts [s], None if there is none.

    A grid lets a fast motion jump over what is narrow: the referee looks between the nodes.
    """
    found = solve(ocp, solver)
    if found.status.is_success and evaluate(found, tolerance=1e-6).violation <= _BETWEEN:
        return found.duration
    return None


def _finding(
    subject: DiagnosedProblem,
    elastic: ElasticProgram,
    answer: ElasticSolution,
    members: tuple[int, ...],
    nodes: np.ndarray,
    p: np.ndarray,
    shortest: float | None,
    duration: float,
) -> Finding:
    demands = [elastic.demands[i] for i in members]
    worst = max(members, key=lambda i: elastic.excess(answer)[i])
    demand, amount = elastic.demands[worst], float(answer.slack[worst])
    mine = elastic.owner == worst
    row = int(np.flatnonzero(mine)[answer.weight[mine].argmax()])
    t = float(subject.data.t0 + nodes[row] / nodes.max(initial=1) * duration)
    if demand.instant is not None:
        t = float(subject.data.t0 + demand.instant)
    names = tuple(dict.fromkeys(name for d in demands for name in d.where))
    labels = [d.label for d in demands]
    said = f"{' and '.join([', '.join(labels[:-1]), labels[-1]])} cannot hold together"
    if len(labels) == 1:
        said = f"{labels[0]} cannot hold with these dynamics"
    parts = [
        f"{said[0].upper()}{said[1:]} (without any one of them the others can be met, near where "
        f"was looked): the least that must give way is {demand.label}, by "
        f"{amount:.3g} {demand.unit}".rstrip()
        + "."
    ]
    parts += _alone(elastic, answer, members, p)
    if shortest is not None:
        later = ", and instants as much later," if subject.written.at("instants") else ""
        parts.append(f"With a horizon of {shortest:.3g} s{later} it becomes possible.")
    return Finding(
        Cause.CONFLICT if shortest is None else Cause.OUT_OF_REACH,
        Severity.ERROR,
        names,
        " ".join(parts),
        amount,
        demand.unit,
        t,
    )


def _alone(
    elastic: ElasticProgram, answer: ElasticSolution, members: tuple[int, ...], p: np.ndarray
) -> Iterator[str]:
    """Yield, for each demand in conflict, its violation where it alone has slack."""
    everything = range(len(elastic.demands))
    for i in members if len(members) > 1 else ():
        demand: Demand = elastic.demands[i]
        single = elastic.solve(answer.w, p, everything, soft=[i])
        if single.found:
            by = f"{single.slack[i]:.3g} {demand.unit}".rstrip()
            yield f"Alone, {demand.label} would have to give way by {by}."
