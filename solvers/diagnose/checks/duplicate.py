"""Equations that depend on each other: their multipliers are not unique."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp import Constraint
from ocp.internal import without_traces
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.subject import DiagnosedProblem, SamplePoints

_RANK = 1e-8
_SHARE = 0.1


def duplicate(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Test the rank of the Jacobian of all equations of a place, at every point."""
    ocp, m = subject.ocp, subject.ocp.model
    points = subject.along + subject.around
    for place, unknowns in (
        ("initial", m.x),
        ("path", ca.vertcat(m.x, m.u)),
        ("terminal", m.x),
    ):
        rows = _equations(ocp.at(place))  # type: ignore[arg-type]
        if len(rows) > 1:
            yield from _dependent(subject, place, rows, unknowns, points)


def _equations(constraints: tuple[Constraint, ...]) -> list[tuple[str, ca.SX]]:
    return [
        (c.name, row)
        for c in constraints
        for row, low, high in zip(
            ca.vertsplit(c.expression), np.asarray(c.lower), np.asarray(c.upper), strict=True
        )
        if low == high
    ]


def _dependent(
    subject: DiagnosedProblem,
    place: str,
    rows: list[tuple[str, ca.SX]],
    unknowns: ca.SX,
    points: SamplePoints,
) -> Iterator[Finding]:
    slope = ca.jacobian(ca.vertcat(*[row for _, row in rows]), unknowns)
    values = without_traces(points.evaluate(subject.ocp, slope)).reshape(
        -1, unknowns.numel(), len(rows)
    )
    values = values[np.isfinite(values).all(axis=(1, 2))]
    if not len(values):
        return
    sizes = np.abs(values).max(axis=1, keepdims=True)
    scaled = values / np.where(sizes > 0.0, sizes, 1.0)
    _, singular, right = np.linalg.svd(scaled, full_matrices=True)
    smallest = singular[:, -1] if singular.shape[1] == len(rows) else np.zeros(len(values))
    if not (smallest <= _RANK * singular[:, 0]).all():
        return
    # Those rows that take part in the dependence somewhere.
    share = np.abs(right[:, -1, :]).max(axis=0)
    names = tuple(dict.fromkeys(rows[i][0] for i in np.flatnonzero(share > _SHARE)))
    yield Finding(
        Cause.DUPLICATE,
        Severity.WARNING,
        names,
        f"The {len(rows)} {place} equations {', '.join(dict.fromkeys(n for n, _ in rows))} depend "
        "on each other wherever they are evaluated (LICQ fails): their multipliers are not "
        f"unique and Newton's matrix is singular. Leave out one of {', '.join(names)}.",
        float(smallest.max()),
    )
