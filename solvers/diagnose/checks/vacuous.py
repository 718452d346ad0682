"""Constraints without effect: their bounds are infinite, or no variable appears in them."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp import Constraint
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import depends
from solvers.diagnose.subject import DiagnosedProblem


def vacuous(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Find constraints without a bound, and without a state or control."""
    m, written = subject.ocp.model, subject.written
    for c in written.constraints:
        if not (np.isfinite(c.lower).any() or np.isfinite(c.upper).any()):
            yield Finding(
                Cause.VACUOUS,
                Severity.WARNING,
                (c.name,),
                f"{_called(subject, c)} has neither a lower nor an upper bound: "
                "give it lower=, upper=, or both the same for an equation.",
                float(c.size),
            )
        elif not depends(c.expression, ca.vertcat(m.x, m.u)) and not _misses(c):
            yield Finding(
                Cause.VACUOUS,
                Severity.WARNING,
                (c.name,),
                f"{_called(subject, c)} contains no state and no control: nothing can "
                "be done about it.",
                float(c.size),
            )


def _misses(c: Constraint) -> bool:
    """Whether ``unreachable`` says by how much: of the equation of an integral."""
    return c.at == "integral" and bool((np.asarray(c.lower) == np.asarray(c.upper)).all())


def _called(subject: DiagnosedProblem, c: Constraint) -> str:
    label = subject.terms.label(c)
    return label[0].upper() + label[1:]
