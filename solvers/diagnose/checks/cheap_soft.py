"""Soft constraints whose price is too low to matter."""

from collections.abc import Iterator
from dataclasses import replace

import casadi as ca
import numpy as np

from ocp import Constraint, Solution
from ocp.internal import excess, sizes_of
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.subject import DiagnosedProblem

# An excess below this share of the size of a row is none.
_NONE = 1e-3
# With the price at least this share of the excess is left: it changes nothing.
_ALL = 0.99


def cheap_soft(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Solve once more without each soft constraint that is exceeded: is it exceeded as much?"""
    if subject.form is None or not subject.trial.status.is_success:
        return
    sizes = sizes_of(subject.form.original).rows
    for c in subject.written.constraints:
        if c.soft is None or not (np.isfinite(c.lower).any() or np.isfinite(c.upper).any()):
            continue
        values = np.abs(subject.tried.evaluate(subject.ocp, excess(c)))
        amount = float((values[-1] if c.at == "terminal" else values).max())
        if amount <= _NONE * float(np.max(sizes[c.name])):
            continue
        without = _excess_without(subject, c)
        if without is not None and amount >= _ALL * without:
            yield _finding(subject, c, amount, without)


def _excess_without(subject: DiagnosedProblem, c: Constraint) -> float | None:
    """Return the largest excess of a constraint if there is none; None: no answer then."""
    form, data = subject.form, subject.data
    assert form is not None
    ocp = form.original
    others = tuple(other for other in ocp.constraints if other.name != c.name)
    known = data.values.as_dict()
    given = {entry.name: known[entry.name] for entry in ocp.parameters}
    given |= {name: data.x0[at] for name, at in form.given.items()}
    found = subject.solver.build(replace(ocp, constraints=others)).run(
        x0=data.x0[: ocp.model.nx], t0=data.t0, parameters=given
    )
    return _excess_of(subject, c, found) if found.status.is_success else None


def _excess_of(subject: DiagnosedProblem, c: Constraint, found: Solution) -> float:
    written = subject.written
    m = written.model
    function = ca.Function("excess", [m.x, m.u, m.t, written.p], [ca.densify(excess(c))])
    p = written.values_of(found.parameters, found.unknowns, found.x[0]).at(found.fractions)
    u = np.vstack([found.u, found.u[-1:]])[: len(found.t)]
    values = np.abs(np.array(function.map(len(found.t))(found.x.T, u.T, found.t[None, :], p.T)).T)
    return float((values[-1] if c.at == "terminal" else values).max())


def _finding(subject: DiagnosedProblem, c: Constraint, amount: float, without: float) -> Finding:
    label = subject.terms.label(c)
    return Finding(
        Cause.CHEAP_SOFT,
        Severity.WARNING,
        (c.name,),
        f"{label[0].upper()}{label[1:]} is exceeded by {amount:.3g}, and by {without:.3g} without "
        "it: its price is too low to matter. A linear price above the multiplier of the hard "
        "constraint is exact; solve once without soft= to see it.",
        amount,
    )
