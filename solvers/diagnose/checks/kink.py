"""Kinks in what is declared smooth, found where they are."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp.internal import deciding
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import appearing, depends, operations, shown
from solvers.diagnose.subject import DiagnosedProblem, SamplePoints

# Operations that switch where one argument, or the difference of two, is zero.
_ONE = (ca.OP_FABS, ca.OP_SIGN)
_TWO = (ca.OP_FMAX, ca.OP_FMIN, ca.OP_LT, ca.OP_LE)
# Those that slack controls replace.
_SLACK = (ca.OP_FABS, ca.OP_FMAX, ca.OP_FMIN)
_ASIDE = 1e-7
_JUMP = 1e-4
_HALVINGS = 50


def kink(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Compare value, slope and curvature on both sides of every switch; name what is undeclared."""
    declared = subject.ocp.smoothness
    yield from (f for f in _switches(subject) if f.evidence < max(declared, 0))


def declared_kinks(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Return the kinks that the problem declares: what explains a solver that fails."""
    declared = subject.ocp.smoothness
    yield from (f for f in _switches(subject) if declared <= f.evidence < 1)


def _switches(subject: DiagnosedProblem) -> Iterator[Finding]:
    ocp, m = subject.ocp, subject.ocp.model
    terms = (
        ("the running cost", ca.SX(ocp.running_cost)),
        ("the terminal cost", ca.SX(ocp.terminal_cost)),
        ("the dynamics", m.f),
    )
    for what, expression in terms:
        worst: dict[int, Finding] = {}  # a decision has many values
        for node in operations(expression):
            switch = _switch(subject, node)
            if switch is None or not depends(switch, ca.vertcat(m.x, m.u)):
                continue
            order = _smoothness(subject, expression, switch)
            if order is not None and order < 2:
                found = _finding(subject, what, node, switch, order)
                key = (node if deciding(node) is None else node.dep(0)).element_hash()
                worst[key] = min(found, worst.get(key, found), key=lambda f: f.evidence)
        yield from worst.values()


def _switch(subject: DiagnosedProblem, node: ca.SX) -> ca.SX | None:
    """Return what is zero where a node switches; of a decision, half-way between two values."""
    if node.op() in _ONE:
        return node.dep(0)
    if deciding(node) is not None:
        values = (subject.around + subject.along).evaluate(subject.ocp, node)
        return node - (values.min() + values.max()) / 2.0
    return node.dep(0) - node.dep(1) if node.op() in _TWO else None


def _smoothness(subject: DiagnosedProblem, expression: ca.SX, switch: ca.SX) -> int | None:
    """Return how often the expression is differentiable across the switch; None if unknown."""
    on = _on_switch(subject, switch)
    if on is None:
        return None
    point, direction = on
    m = subject.ocp.model
    z = ca.vertcat(m.x, m.u)
    slope = ca.jacobian(expression, z)
    curvature = ca.jacobian(slope, z)
    before, after = (_shift(point, s * _ASIDE * direction, m.nx) for s in (-1, 1))
    for order, derivative in enumerate((expression, slope, curvature)):
        left, right = (p.evaluate(subject.ocp, derivative) for p in (before, after))
        jump = np.abs(right - left).max()
        if not jump <= _JUMP * (1.0 + np.abs(left).max()):
            return order - 1
    return 2


def _on_switch(subject: DiagnosedProblem, switch: ca.SX) -> tuple[SamplePoints, np.ndarray] | None:
    """Return a point at which the switch is zero, and a direction across it, by bisection."""
    ocp, m = subject.ocp, subject.ocp.model
    points = subject.around + subject.along
    values = points.evaluate(ocp, switch).ravel()
    above, below = np.flatnonzero(values > 0.0), np.flatnonzero(values < 0.0)
    if not above.size or not below.size:
        return None
    i, j = above[0], below[0]
    start, end = (np.hstack([points.x[k], points.u[k]]) for k in (j, i))
    at = (points.t[[i]], points.p[[i]])
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        z = (start + middle * (end - start))[None, :]
        value = SamplePoints(z[:, : m.nx], z[:, m.nx :], *at).evaluate(ocp, switch)[0, 0]
        low, high = (low, middle) if value > 0.0 else (middle, high)
    z = (start + high * (end - start))[None, :]
    apart = float(np.linalg.norm(end - start))
    if apart == 0.0:
        return None
    return SamplePoints(z[:, : m.nx], z[:, m.nx :], *at), (end - start) / apart


def _shift(point: SamplePoints, by: np.ndarray, nx: int) -> SamplePoints:
    return SamplePoints(point.x + by[:nx], point.u + by[nx:], point.t, point.p)


def _finding(
    subject: DiagnosedProblem, what: str, node: ca.SX, switch: ca.SX, order: int
) -> Finding:
    sort = {-1: "jumps", 0: "has a kink", 1: "has a jump in its second derivative"}[order]
    declared = subject.ocp.smoothness
    known = order >= 0 and declared <= order
    decision = deciding(node)
    where = (
        f"{shown(switch)} = 0, in {shown(node)}"
        if decision is None
        else f"'{decision.name()}' decides for something else"
    )
    said = f"{what[0].upper()}{what[1:]} {sort} where {where}"
    said += "" if known else f", but smoothness={declared} is declared"
    return Finding(
        Cause.KINK,
        Severity.WARNING,
        appearing(subject.ocp, switch),
        f"{said}: {_consequence(order)}. {_remedy(what, node, order)}",
        float(order),
    )


def _consequence(order: int) -> str:
    if order < 0:
        return "derivatives do not see a jump, and no grid makes the answer an optimum"
    return "Newton's method may cycle there"


def _remedy(what: str, node: ca.SX, order: int) -> str:
    """Return what to write instead; declaring a kink does not make a method converge on it."""
    smooth = "sqrt(a**2 + eps**2) for abs(a), (a + b + sqrt((a - b)**2 + eps**2)) / 2 for max(a, b)"
    if order < 0:
        return (
            "Describe each branch as a phase of its own whose duration is free, or write "
            "(1 + tanh(d / width)) / 2 for d > 0 and reduce the width."
        )
    if order == 1:
        return "Declare smoothness=1, or take a term with continuous second derivatives."
    if what == "the running cost" and node.op() in _SLACK:
        return (
            "Solve ocp.without_kinks(problem), which has a slack control and inequalities in its "
            "place and the same optimum; Collocation does it by itself, and MultipleShooting where "
            "only controls decide the kink. By hand, for abs(u) of a control u: "
            "controls p and m with control_bounds Box(0, ...), p - m in place of u, p + m in place "
            "of abs(u)."
        )
    if deciding(node) is not None:
        return "smoothness=0 says so; a distance from a ball has no kink where the ball is outside."
    return f"Write {smooth}, and reduce eps; smoothness=0 says that there is a kink."
