"""Second derivatives of the costs: controls without a minimum, states driven away."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp.internal import without_traces
from solvers.diagnose.cause import Cause
from solvers.diagnose.checks.influence import feeding
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import depends
from solvers.diagnose.subject import DiagnosedProblem

# A second derivative more negative than this, relative to the largest, is negative.
_NEGATIVE = 1e-9


def curvature(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Check the second derivatives of the costs."""
    yield from _linear(subject)
    yield from _concave_control(subject)
    yield from _concave_state(subject)


def _linear(subject: DiagnosedProblem) -> Iterator[Finding]:
    ocp, m = subject.ocp, subject.ocp.model
    cost = ca.SX(ocp.running_cost)
    path = ca.vertcat(ca.SX(0, 1), *[c.expression for c in ocp.at("path")])
    lower, upper = np.asarray(ocp.control_bounds.lower), np.asarray(ocp.control_bounds.upper)
    for i, name in enumerate(m.u_names):
        u, is_free = m.u[i], np.isinf(lower[i]) or np.isinf(upper[i])
        if not is_free or depends(path, u) or not depends(m.f, u):
            continue
        slope = ca.jacobian(cost, u)
        if depends(slope, m.u) or depends(ca.jacobian(m.f, u), m.u):
            continue
        if not slope.nnz():
            if not _determined(subject, i):
                yield _free(subject, name)
        else:
            values = subject.along.evaluate(ocp, slope)
            yield _linear_in(subject, name, float(values[np.isfinite(values)].mean()))


def _determined(subject: DiagnosedProblem, i: int) -> bool:
    """Whether an equation on the way fixes a state that the control moves, and so the control.

    Such as the force in a rod, which keeps its length.
    """
    ocp, m = subject.ocp, subject.ocp.model
    equations = [
        row
        for c in ocp.at("path")
        for row, low, high in zip(
            ca.vertsplit(c.expression), np.asarray(c.lower), np.asarray(c.upper), strict=True
        )
        if low == high
    ]
    if not equations:
        return False
    fixed = np.array([depends(ca.vertcat(*equations), m.x[k]) for k in range(m.nx)])
    moved = np.array([depends(m.f[k], m.u[i]) for k in range(m.nx)])
    return bool((feeding(ocp, fixed) & moved).any())


def _free(subject: DiagnosedProblem, name: str) -> Finding:
    # In discrete time the next state's cost bends in the control: dead-beat is an optimum.
    discrete = subject.ocp.model.is_discrete
    return Finding(
        Cause.FREE_CONTROL,
        Severity.ADVICE if discrete else Severity.ERROR,
        (name,),
        f"The control {name} is unbounded and the running cost does not contain it"
        + (
            ": any size is free of charge. Add its square, or a bound."
            if discrete
            else ": the optimum is an impulse that no grid can show. Add its square to the cost, "
            "or bound it."
        ),
        0.0,
    )


def _linear_in(subject: DiagnosedProblem, name: str, slope: float) -> Finding:
    unit = subject.unit(name)
    return Finding(
        Cause.LINEAR_COST,
        Severity.WARNING if subject.ocp.model.is_discrete else Severity.ERROR,
        (name,),
        f"Cost and dynamics are linear in the unbounded control {name} (slope {slope:.3g}"
        + (f" per {unit}" if unit else "")
        + f"): there is no finite minimum. Was {name}**2 meant instead of a factor? "
        "Otherwise bound it.",
        slope,
    )


def _concave_control(subject: DiagnosedProblem) -> Iterator[Finding]:
    ocp, m = subject.ocp, subject.ocp.model
    if not m.nu:
        return
    hessian = ca.hessian(ca.SX(ocp.running_cost), m.u)[0]
    points = subject.along + subject.around
    values = without_traces(points.evaluate(ocp, hessian)).reshape(-1, m.nu, m.nu)
    values = values[np.isfinite(values).all(axis=(1, 2))]
    if not len(values) or not np.abs(values).max() > 0.0:
        return
    low, vectors = np.linalg.eigh(values)
    if not (low[:, 0] < -_NEGATIVE * np.abs(values).max()).all():
        return
    i = int(np.abs(vectors[0, :, 0]).argmax())
    free = np.isinf(ocp.control_bounds.lower[i]) or np.isinf(ocp.control_bounds.upper[i])  # type: ignore[index]
    end = "without limit" if free else "up to its bounds"
    yield Finding(
        Cause.WRONG_SIGN,
        Severity.ERROR if free else Severity.WARNING,
        (m.u_names[i],),
        f"The running cost bends downwards in the control {m.u_names[i]} (second derivative "
        f"{low[:, 0].max():.3g}): a minimiser makes it as large as it can, {end}. "
        "Check the sign of its weight; what is to be maximised needs a minus as a whole.",
        float(low[:, 0].max()),
    )


def _concave_state(subject: DiagnosedProblem) -> Iterator[Finding]:
    ocp, m = subject.ocp, subject.ocp.model
    points = subject.along + subject.around
    for what, cost in (("running", ocp.running_cost), ("terminal", ocp.terminal_cost)):
        gradient = ca.gradient(ca.SX(cost), m.x)
        diagonal = ca.vertcat(*[ca.jacobian(gradient[i], m.x[i]) for i in range(m.nx)])
        values = without_traces(points.evaluate(ocp, diagonal))
        values = values[np.isfinite(values).all(axis=1)]
        scale = np.abs(values).max(initial=0.0)
        if not scale > 0.0:
            continue
        wrong = np.flatnonzero((values < -_NEGATIVE * scale).all(axis=0))
        if wrong.size:
            names = tuple(m.x_names[i] for i in wrong)
            steepest = float(values[:, wrong].min())
            yield Finding(
                Cause.WRONG_SIGN,
                Severity.WARNING,
                names,
                f"The {what} cost bends downwards in {', '.join(names)} (second derivative "
                f"{steepest:.3g}): a minimiser drives it away from where the cost is "
                "largest. Check the sign of the weight.",
                steepest,
            )
