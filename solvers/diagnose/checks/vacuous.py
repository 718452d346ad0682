"""Constraints without effect: their bounds are infinite, or no variable appears in them."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import depends
from solvers.diagnose.subject import DiagnosedProblem


def vacuous(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Find constraints without a bound, and without a state or control."""
    m = subject.ocp.model
    for c in subject.ocp.constraints:
        if not (np.isfinite(c.lower).any() or np.isfinite(c.upper).any()):
            yield Finding(
                Cause.VACUOUS,
                Severity.WARNING,
                (c.name,),
                f"The {c.at} constraint '{c.name}' has neither a lower nor an upper bound: "
                "give it lower=, upper=, or both the same for an equation.",
                float(c.size),
            )
        elif not depends(c.expression, ca.vertcat(m.x, m.u)):
            yield Finding(
                Cause.VACUOUS,
                Severity.WARNING,
                (c.name,),
                f"The {c.at} constraint '{c.name}' contains no state and no control: nothing can "
                "be done about it.",
                float(c.size),
            )
