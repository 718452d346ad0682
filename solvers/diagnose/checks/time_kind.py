"""A rate where a next state belongs, or the other way round."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.subject import DiagnosedProblem

# The diagonal of df/dx: near 1 for a next state after a short step, near or below 0 for a rate.
_RATE, _NEAR = 0.2, 0.1
# How large everything off the identity may be after one sampled step.
_STEP = 0.5


def time_kind(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Compare df/dx with the identity."""
    m = subject.ocp.model
    points = subject.along + subject.around
    slopes = points.evaluate(subject.ocp, ca.jacobian(m.f, m.x)).reshape(-1, m.nx, m.nx, order="C")
    slopes = np.swapaxes(slopes, 1, 2)  # CasADi stacks columns
    if not np.isfinite(slopes).all():
        return
    diagonal = np.diagonal(slopes, axis1=1, axis2=2)
    typical = np.median(diagonal, axis=0)
    rest = np.abs(np.median(slopes, axis=0) - np.eye(m.nx)).max()
    if m.is_discrete and (typical <= _RATE).all() and m.nx > 1:
        yield Finding(
            Cause.TIME_KIND,
            Severity.WARNING,
            m.x_names,
            f"The model has dt = {m.dt} s, so f must be the next state; but df/dx is nowhere near "
            f"the identity (its diagonal is at most {typical.max():.2g}): f looks like dx/dt. "
            "Leave dt out, or write x + dt * f or discretise(...).",
            float(typical.max()),
        )
    if m.is_discrete and m.nx == 1 and (diagonal < 0.0).all():
        yield Finding(
            Cause.TIME_KIND,
            Severity.WARNING,
            m.x_names,
            f"The model has dt = {m.dt} s, so f must be the next state; but it falls as "
            f"{m.x_names[0]} grows (df/dx is at most {diagonal.max():.2g}), which no sampled "
            "differential equation in one state does, since its solutions cannot cross: f looks "
            "like dx/dt. Leave dt out, or write x + dt * f or discretise(...).",
            float(diagonal.max()),
        )
    if not m.is_discrete and np.abs(typical - 1.0).max() <= _NEAR and rest <= _STEP:
        yield Finding(
            Cause.TIME_KIND,
            Severity.WARNING,
            m.x_names,
            "The model has no dt, so f must be dx/dt; but df/dx is the identity but for "
            f"{rest:.2g}: f looks like a next state. Give dt, or subtract x and divide by the "
            "step.",
            float(rest),
        )
