"""Functions and derivatives that are not finite along the first iterate."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp.internal import undefined_call
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import appearing, operations, shown
from solvers.diagnose.subject import DiagnosedProblem, SamplePoints

# What makes an operation singular: its argument, from where on, and what it is called.
_SINGULAR = {
    ca.OP_SQRT: ("the square root of", "not be 0 or negative", lambda a: a <= 0),
    ca.OP_LOG: ("the logarithm of", "not be 0 or negative", lambda a: a <= 0),
    ca.OP_INV: ("the inverse of", "not be 0", lambda a: a == 0),
    ca.OP_ASIN: ("the arc sine of", "stay inside (-1, 1)", lambda a: abs(a) >= 1),
    ca.OP_ACOS: ("the arc cosine of", "stay inside (-1, 1)", lambda a: abs(a) >= 1),
    ca.OP_DIV: ("a division by", "not be 0", lambda a: a == 0),
    ca.OP_POW: ("a broken power of", "not be 0 or negative", lambda a: a <= 0),
    ca.OP_CONSTPOW: ("a broken power of", "not be 0 or negative", lambda a: a <= 0),
}


def not_finite(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Name the first term that is NaN or infinite, with its derivatives, and when."""
    last = len(subject.along.t) - 1
    for what, expression, at_end in _terms(subject):
        points = _only(subject.along, last) if at_end else subject.along
        bad = _bad(subject, expression, points)
        if bad.size:
            yield _finding(subject, what, expression, _only(points, int(bad[0])))


def not_finite_after(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Do the same where a failed trial has ended: a search may leave where terms are defined."""
    if subject.trial.status.is_success:
        return
    last = len(subject.tried.t) - 1
    for points in (subject.tried, _ahead(subject)):
        for what, expression, at_end in _terms(subject):
            here = _only(points, last) if at_end else points
            bad = _bad(subject, expression, here)
            if bad.size:
                yield _finding(subject, what, expression, _only(here, int(bad[0])))
                return


def _ahead(subject: DiagnosedProblem) -> SamplePoints:
    """Return where the first controls lead, if the states go on straight from the last node.

    A roll-out is no number from where it leaves what a table or an equation is defined for.
    """
    near, grid = subject.along, subject.program.grid
    data, ocp = subject.data, subject.ocp
    after = np.array(grid.rollout(data.x0, near.u[:-1].T, *grid.schedule(data, ocp.duration))[0])
    x = np.vstack([data.x0, after.T])
    count = int(np.isfinite(x).all(axis=1).cumprod().sum())
    k = min(count, len(x) - 1)
    step = (x[k - 1] - x[k - 2]) if k > 1 else np.zeros(len(data.x0))
    x[count:] = x[k - 1] + step
    return SamplePoints(x, near.u, near.t, near.p)


def _terms(subject: DiagnosedProblem) -> Iterator[tuple[str, ca.SX, bool]]:
    ocp = subject.ocp
    for name, row in zip(ocp.model.x_names, ca.vertsplit(ocp.model.f), strict=True):
        yield f"the dynamics of {name}", row, False
    yield "the running cost", ca.SX(ocp.running_cost), False
    yield "the terminal cost", ca.SX(ocp.terminal_cost), True
    for c in ocp.constraints:
        yield subject.terms.label(c), c.expression, c.at == "terminal"


def _bad(subject: DiagnosedProblem, expression: ca.SX, points: SamplePoints) -> np.ndarray:
    """Return the points at which value or slope is not finite."""
    m = subject.ocp.model
    slope = ca.jacobian(expression, ca.vertcat(m.x, m.u))
    values = points.evaluate(subject.ocp, ca.vertcat(ca.vec(expression), ca.vec(slope)))
    return np.flatnonzero(~np.isfinite(values).all(axis=1))


def _only(points: SamplePoints, i: int) -> SamplePoints:
    return SamplePoints(points.x[[i]], points.u[[i]], points.t[[i]], points.p[[i]])


def _finding(
    subject: DiagnosedProblem, what: str, expression: ca.SX, point: SamplePoints
) -> Finding:
    t = float(point.t[0])
    for node in operations(expression):
        if node.op() not in _SINGULAR:
            continue
        called, rule, is_singular = _SINGULAR[node.op()]
        argument = node.dep(1) if node.op() == ca.OP_DIV else node.dep(0)
        value = float(point.evaluate(subject.ocp, argument)[0, 0])
        if is_singular(value) or not np.isfinite(value):
            return Finding(
                Cause.NOT_FINITE,
                Severity.ERROR,
                appearing(subject.ocp, argument, written=True)
                or appearing(subject.ocp, expression),
                f"In {what}, {called} {shown(argument)} = {value:.3g}: the value or its derivative "
                f"is no number there. The argument must {rule}: start or guess elsewhere, bound "
                "the state away from it, or add a small constant inside.",
                value,
                instant=t,
            )
    if lost := _undefined(subject, expression, point):
        return Finding(
            Cause.NOT_FINITE,
            Severity.ERROR,
            appearing(subject.ocp, expression),
            f"In {what}, {lost}.",
            float("inf"),
            instant=t,
        )
    return Finding(
        Cause.NOT_FINITE,
        Severity.ERROR,
        appearing(subject.ocp, expression),
        f"{what[0].upper()}{what[1:]} or its derivative overflows or is NaN on the first iterate: "
        "give a guess that stays where it is defined.",
        float("inf"),
        instant=t,
    )


def _undefined(subject: DiagnosedProblem, expression: ca.SX, point: SamplePoints) -> str:
    """Return which function that is called has no value at a point; "" if none is found."""
    m = subject.ocp.model
    numbers = np.hstack([point.x, point.u, point.t[:, None], point.p])
    found = undefined_call(expression, ca.vertcat(m.x, m.u, m.t, subject.ocp.p), numbers)
    return found.said if found else ""
