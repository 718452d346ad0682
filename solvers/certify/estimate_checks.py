"""What is asked of the estimates: that they agree, and that the best one meets the conditions."""

from collections.abc import Sequence
from dataclasses import replace

from ocp import Status
from solvers.certify.certificate import AGREEMENT, Check, Estimate, Verdict, agreement
from solvers.certify.hamiltonian_check import hamiltonian_check

# So many independent methods are compared.
METHODS = 2
RELATIVE = "relative agreement"
FEASIBILITY, SECOND_ORDER = "feasibility", "second order"
# Of a smooth problem no path constraint is active: it is asked more than one where one is.
# Digits that two methods have to share.
SMOOTH_DIGITS, OTHER_DIGITS = 8, 5
# Digits count from 1; of a smaller cost itself two methods may differ by this share.
_APART = 1e-3
_SMOOTH_VIOLATION, OTHER_VIOLATION = 1e-8, 1e-5
_SMOOTH_DRIFT, _OTHER_DRIFT = 1e-6, 1e-3


def most_violated(smooth: bool) -> float:
    """Return by how much rows may be missed."""
    return _SMOOTH_VIOLATION if smooth else OTHER_VIOLATION


def agreement_check(estimates: Sequence[Estimate], smooth: bool) -> Check:
    """The digits that two methods have in common."""
    if len(estimates) < METHODS:
        return Check(AGREEMENT, Verdict.FAILS, "one method only")
    first, second = estimates
    digits, asked = agreement(first.cost, second.cost), SMOOTH_DIGITS if smooth else OTHER_DIGITS
    said = f"{digits:.1f} digits between {first.method} and {second.method}; {asked} asked"
    verdict = Verdict.HOLDS if digits >= asked else Verdict.FAILS
    return Check(AGREEMENT, verdict, said, digits, asked)


def relative_agreement(estimates: Sequence[Estimate]) -> Check:
    """Tolerances are absolute below 1: methods that see next to no cost agree on any trajectory."""
    if len(estimates) < METHODS:
        return Check.skipped(RELATIVE, "one method only")
    first, second = estimates
    apart, size = abs(first.cost - second.cost), abs(first.cost)
    said = f"{apart:.1e} apart at a cost of {size:.1e}"
    if apart > _APART * size:
        said += ": too small for the tolerances, state it in smaller units"
    return Check.at_most(RELATIVE, apart, _APART * size, said)


def feasibility(best: Estimate, smooth: bool) -> Check:
    """What the referee sees violated."""
    said = f"the referee sees a violation of {best.violation:.1e}"
    return Check.at_most(FEASIBILITY, best.violation, most_violated(smooth), said)


def kept_hamiltonian(best: Estimate, unique: bool) -> Check:
    """Decisive where the costates are unique, which those of a direct method need not be."""
    check = hamiltonian_check(best.solution, _SMOOTH_DRIFT if best.is_extremal else _OTHER_DRIFT)
    return check if best.is_extremal or unique else replace(check, decisive=False)


def second_order(best: Estimate) -> Check:
    """The second-order test of ``polish``: no conjugate point."""
    if not best.is_extremal:
        return Check.skipped(SECOND_ORDER, "no extremal to test: see the curvature on the grid")
    if best.solution.status is Status.SOLVED:
        return Check(SECOND_ORDER, Verdict.HOLDS, "H_uu > 0 and no conjugate point")
    if best.solution.problem.has_free_time:
        return Check.skipped(SECOND_ORDER, best.solution.message)
    return Check(SECOND_ORDER, Verdict.FAILS, best.solution.message)
