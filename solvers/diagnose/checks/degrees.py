"""Angles in radians whose numbers look like degrees."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import depends, operations
from solvers.diagnose.subject import DiagnosedProblem

# Larger angles in round numbers are hardly meant as radians.
_LEAST, _ROUND, _ROUNDING = 10.0, 5.0, 1e-9


def degrees(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Compare starts, bounds, targets and wanted values of every angle with 10, in fives.

    Controls in radians too, by their bounds.
    """
    names = subject.ocp.model.x_names
    found = [(names[i], *said) for i in _angles(subject) for said in _numbers(subject, i)]
    named: set[str] = set()
    for name, what, value in (*found, *_of_controls(subject)):
        round_one = np.isfinite(value) and abs(value) >= _LEAST and value % _ROUND < _ROUNDING
        if round_one and name not in named:
            named.add(name)
            yield Finding(
                Cause.DEGREES,
                Severity.WARNING,
                (name,),
                f"The {what} of {name} is {value:g} rad, {value / (2 * np.pi):.3g} turns. "
                f"If degrees are meant, write {np.deg2rad(value):.6g} (numpy.deg2rad).",
                float(value),
                "rad",
            )


def _of_controls(subject: DiagnosedProblem) -> Iterator[tuple[str, str, float]]:
    """Yield the bounds of every control in radians."""
    m, box = subject.ocp.model, subject.ocp.control_bounds
    for i, unit in enumerate(m.u_units):
        if unit == "rad":
            for side in ("lower", "upper"):
                yield m.u_names[i], f"{side} bound", float(np.asarray(getattr(box, side))[i])


def _angles(subject: DiagnosedProblem) -> Iterator[int]:
    """Yield the states in radians; without units, those that a sine or cosine takes."""
    m = subject.ocp.model
    if m.x_units:
        yield from (i for i, unit in enumerate(m.x_units) if unit == "rad")
    asked = subject.constants if m.x_units else range(m.nx)
    turned = [n.dep(0) for n in operations(m.f) if n.op() in (ca.OP_SIN, ca.OP_COS)]
    slopes = ca.jacobian(ca.vertcat(ca.SX(0, 1), *turned), m.x)
    yield from (i for i in asked if slopes[:, i].nnz() and slopes[:, i].is_constant())


def _numbers(subject: DiagnosedProblem, i: int) -> Iterator[tuple[str, float]]:
    ocp = subject.ocp
    symbol = ocp.model.x[i]
    for side in ("lower", "upper"):
        yield f"{side} bound", float(np.asarray(getattr(ocp.state_bounds, side))[i])
        yield f"{side} bound", float(np.asarray(getattr(ocp.start_bounds, side))[i])
    for c in subject.written.constraints:
        for row, low, high in zip(
            ca.vertsplit(c.expression), np.asarray(c.lower), np.asarray(c.upper), strict=True
        ):
            if ca.is_equal(row, symbol, 1):
                yield f"lower end of '{c.name}'", float(low)
                yield f"upper end of '{c.name}'", float(high)
    for what, cost in (("terminal", ocp.terminal_cost), ("running", ocp.running_cost)):
        value = _wanted(subject, ca.SX(cost), symbol)
        if value is not None:
            yield f"value wanted by the {what} cost", value
    yield "start", float(subject.data.x0[i])


def _wanted(subject: DiagnosedProblem, cost: ca.SX, symbol: ca.SX) -> float | None:
    """Return the minimiser of a cost that is quadratic in one state, None if it is not."""
    slope = ca.jacobian(cost, symbol)
    curvature = ca.jacobian(slope, symbol)
    ocp = subject.ocp
    if not curvature.nnz() or depends(curvature, ca.vertcat(ocp.model.x, ocp.model.u)):
        return None
    x, g, h = subject.along.evaluate(ocp, ca.vertcat(symbol, slope, curvature))[0]
    value = x - g / h if h > 0.0 else np.nan
    return float(value) if np.isfinite(value) else None
