"""A certificate of phases side by side, with what the referee says of them as they are written."""

from dataclasses import replace

from ocp import PhasesSolution, evaluate
from solvers.certify.certificate import Certificate, Check

# Costs of the same phases, integrated side by side and one by one.
_SAME_COST = 1e-8


def with_phases(found: Certificate, given: PhasesSolution, most_violated: float) -> Certificate:
    """Return a certificate with the checks of its answer phase by phase, each on its own clock.

    Args:
        found: of the phases side by side.
        given: a solution of the same phases.
        most_violated: what a bound, a constraint or a link may be missed by.
    """
    verdict = evaluate(PhasesSolution(given.side, found.solution))
    apart = abs(verdict.cost - evaluate(found.solution).cost)
    said = f"side by side and phase by phase the referee's costs differ by {apart:.1e}"
    missed = f"the referee sees a violation of {verdict.violation:.1e}, links included"
    checks = (
        Check.at_most("phases, cost", apart, _SAME_COST * max(1.0, abs(verdict.cost)), said),
        Check.at_most("phases, feasibility", verdict.violation, most_violated, missed),
    )
    return replace(found, checks=(*found.checks, *checks))
