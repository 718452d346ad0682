"""What cannot be met at one instant, whatever the dynamics do."""

from collections.abc import Iterator

import numpy as np

from solvers.diagnose.cause import Cause
from solvers.diagnose.demands import Asked, at_instant, of_box, of_constraint, of_start
from solvers.diagnose.elastic_program import ElasticProgram, ElasticSolution
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import depends
from solvers.diagnose.subject import DiagnosedProblem

# Different starts before constraints that are not convex are called contradictory.
_STARTS = 8


def instants(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Look for contradictions on the way, at instants and both ends, then at the given start."""
    found = [*_anywhere(subject, "on the way"), *_anywhere(subject, "at the end")]
    found += _waypoints(subject)
    if subject.written.has_free_start:
        found += _anywhere(subject, "at the start")
    elif not found:
        found += _start(subject)
    yield from found


def _anywhere(subject: DiagnosedProblem, when: str) -> Iterator[Finding]:
    asked = _asked(subject, when)
    if not asked:
        return
    row = {"at the start": 0, "on the way": len(subject.along.t) // 2, "at the end": -1}[when]
    t, fraction = float(subject.along.t[row]), {0: 0.0, -1: 1.0}.get(row, 0.5)
    given = _given(subject) if when == "at the start" else []
    elastic = at_instant(subject, asked, t, fraction, given)
    yield from _contradictions(subject, elastic, when, t)


def _contradictions(
    subject: DiagnosedProblem, elastic: ElasticProgram, when: str, t: float
) -> Iterator[Finding]:
    answer = _least(subject, elastic)
    if answer is None:
        return
    conflict = elastic.conflict(answer, np.empty(0))
    if not _met_from_elsewhere(elastic, answer, conflict):
        yield _contradiction(elastic, answer, conflict, when, t)


def _waypoints(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Look at each instant at which a constraint holds: with the bounds, and the others there."""
    ocp, written = subject.ocp, subject.written
    at = written.at("instants")
    always = [*of_box(subject, "state"), *of_start(subject, only_constants=True)]
    for c in ocp.at("path"):
        always += [a for a in of_constraint(subject, c) if not depends(a[1], ocp.model.u)]
    for instant in np.unique(np.concatenate([np.zeros(0), *[c.instants for c in at]])):
        here = [c for c in at if (c.instants == instant).any()]
        own = [a for c in here for a in of_constraint(subject, c, float(instant))]
        t, fraction = subject.data.t0 + float(instant), float(instant / ocp.duration)
        elastic = at_instant(subject, [*own, *always], t, fraction)
        found = list(_contradictions(subject, elastic, f"at {instant:g} s", t))
        yield from found
        if found:
            return


def _given(subject: DiagnosedProblem) -> list[int]:
    """Return the states whose start is given."""
    return np.flatnonzero(~subject.ocp.start_is_free).tolist()


def _asked(subject: DiagnosedProblem, when: str) -> list[Asked]:
    """Return what holds at an instant; what the end asks of controls is left to the way."""
    ocp = subject.ocp
    path = [a for c in ocp.at("path") for a in of_constraint(subject, c)]
    states = [*of_box(subject, "state"), *of_start(subject, only_constants=True)]
    if when == "on the way":
        return [*of_box(subject, "control"), *states, *path] if path else []
    here = ocp.at("terminal" if when == "at the end" else "initial")
    written = [c for c in here if subject.terms.is_written(c)]
    own = [a for c in written for a in of_constraint(subject, c)]
    if when == "at the start":
        own += of_start(subject)
        states = [a for a in states if not depends(a[1], ocp.model.x[_given(subject)])]
        path = [*path, *of_box(subject, "control")] if path else []
        return [*own, *states, *path] if own or path else []
    if not own:
        return []
    return [*own, *states, *(a for a in path if not depends(a[1], ocp.model.u))]


def _least(subject: DiagnosedProblem, elastic: ElasticProgram) -> ElasticSolution | None:
    """Return the least violating answer over several starts; None if all can be met."""
    along, around = subject.along, subject.around
    x = np.vstack([along.x[[0, -1]], around.x])[:_STARTS]
    u = np.vstack([along.u[[0, -1]], around.u])[:_STARTS]
    return _least_from(elastic, np.nan_to_num(np.hstack([x, u])))


def _least_from(elastic: ElasticProgram, starts: np.ndarray) -> ElasticSolution | None:
    """Return the least violating answer from some starts; None if all can be met, or unknown."""
    best = None
    for w0 in starts:
        answer = elastic.solve(w0, np.empty(0), range(len(elastic.demands)))
        if elastic.is_possible(answer):
            return None
        total = elastic.excess(answer).sum()
        if answer.found and (best is None or total < elastic.excess(best).sum()):
            best = answer
    return best


def _met_from_elsewhere(
    elastic: ElasticProgram, answer: ElasticSolution, conflict: tuple[int, ...]
) -> bool:
    """Whether all can be met from where all but one of the conflict are.

    The far side of an obstacle is found from where the end is asked for, not from the start.
    """
    nothing, every = np.empty(0), range(len(elastic.demands))
    for left_out in conflict:
        others = elastic.solve(answer.w, nothing, [i for i in every if i != left_out])
        if others.found and elastic.is_possible(elastic.solve(others.w, nothing, every)):
            return True
    return False


def _contradiction(
    elastic: ElasticProgram, answer: ElasticSolution, conflict: tuple[int, ...], when: str, t: float
) -> Finding:
    members = [elastic.demands[i] for i in conflict]
    worst = int(elastic.excess(answer).argmax())
    demand, amount = elastic.demands[worst], float(answer.slack[worst])
    if len(members) == 1:
        said = f"{members[0].label[0].upper()}{members[0].label[1:]} cannot be met by itself"
    else:
        said = f"No state and control meet together {_listed([d.label for d in members])}"
    return Finding(
        Cause.CONTRADICTION,
        Severity.ERROR,
        _names(members),
        f"{said} {when}, whatever the dynamics: {demand.label} would have to give way by "
        f"{amount:.3g} {demand.unit}".rstrip()
        + ". Relax one of them.",
        amount,
        demand.unit,
        t,
    )


def _start(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Is there a control with which the given start meets the path constraints?"""
    ocp = subject.ocp
    path = [a for c in ocp.at("path") for a in of_constraint(subject, c)]
    if not path:
        return
    constants = of_start(subject, only_constants=True)
    fixed = [*of_box(subject, "control"), *path, *constants]
    x0, t0 = subject.data.x0, subject.data.t0
    elastic = at_instant(subject, fixed, t0, 0.0, _given(subject))
    # From several controls: at one of them the gradient of a constraint may vanish.
    controls = np.vstack([subject.along.u[:1], subject.around.u])[:_STARTS]
    answer = _least_from(elastic, np.hstack([np.tile(x0, (len(controls), 1)), controls]))
    if answer is None:
        return
    worst = int(elastic.excess(answer).argmax())
    demand, amount = elastic.demands[worst], float(answer.slack[worst])
    equation = any(d == demand and low == high for d, _, low, high in fixed)
    advice = (
        "An equation on the whole path holds at the start too: was at='terminal' meant?"
        if equation
        else "Change x0, or relax the constraint."
    )
    yield Finding(
        Cause.START_VIOLATES,
        Severity.ERROR,
        demand.where,
        f"At x0, whatever the control, {demand.label} is violated by {amount:.3g} "
        f"{demand.unit}".rstrip()
        + f". {advice}",
        amount,
        demand.unit,
        t0,
    )


def _names(demands: list) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for d in demands for name in d.where))


def _listed(labels: list[str]) -> str:
    return " and ".join([", ".join(labels[:-1]), labels[-1]])
