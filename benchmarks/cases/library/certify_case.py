"""How the certificate of a case is made."""

from benchmarks.cases import Case, PhasesCase
from ocp import PhasesSolution, Solution, SolverError
from solvers import Certificate, CertifyOptions, MultipleShooting, certify, multistart
from solvers.internal import Check

CLOSED_FORM = "closed form"
# Digits in which a certificate has to agree with a derivation.
_CLOSED_FORM_ERROR = 1e-8
# Where a certificate starts: the finer grid where the coarser solves nothing; what held
# controls violate between nodes is left to its methods.
_INTERVALS, _BETWEEN = (75, 300), 0.1


def certify_case(case: Case | PhasesCase, effort: CertifyOptions) -> Certificate:
    """Certify the best optimum that a few direct starts find.

    The problem's own guess is the first of them. Where the case knows a closed form, that is a
    method of its own, and how far the second numerical one gets decides nothing.

    Raises:
        SolverError: if none of them is feasible.
        UnsupportedProblem: if no method says anything.
    """
    certificate = certify(_best_start(case, effort), effort)
    reference = case.reference
    if reference is None or not reference.is_closed_form:
        return certificate
    apart = abs(certificate.cost - reference.value) / max(1.0, abs(reference.value))
    said = f"{reference.value:.12g}, {apart:.1e} apart ({reference.how})"
    return certificate.beside(Check.at_most(CLOSED_FORM, apart, _CLOSED_FORM_ERROR, said))


def _best_start(case: Case | PhasesCase, effort: CertifyOptions) -> Solution | PhasesSolution:
    ocp = case.build()
    for intervals in _INTERVALS:
        solver = MultipleShooting(intervals)
        found = multistart(ocp, solver, effort.starts, effort.seed, violation=_BETWEEN)
        if found:
            return found[0].solution
    raise SolverError(f"{case.name}: none of {effort.starts} starts is feasible")
