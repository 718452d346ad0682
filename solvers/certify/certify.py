"""Certify an optimal value: independent methods, and every condition that can be checked."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from ocp import Solution, Status, UnsupportedProblem, instance, whole
from solvers.certify.certificate import AGREEMENT, Certificate, Check, Estimate, Verdict, agreement
from solvers.certify.conserved import hamiltonian_check
from solvers.certify.discrete_estimates import by_linear_method, by_nonlinear_program
from solvers.certify.estimates import (
    NoEstimateError,
    by_collocation,
    by_polish,
    by_shooting,
    on_grid,
)
from solvers.certify.global_evidence import (
    CONVEXITY,
    EXTREMALS,
    STARTS,
    convexity,
    every_extremal,
    other_data,
    other_starts,
)
from solvers.certify.grid_conditions import grid_checks

# So many independent methods are compared.
_METHODS = 2
RELATIVE = "relative agreement"
FEASIBILITY, SECOND_ORDER = "feasibility", "second order"
# Digits asked of two methods: where no path constraint is active, and where one is.
SMOOTH_DIGITS, OTHER_DIGITS = 8, 5
# Digits count from 1; of a smaller cost itself two methods may differ by this share.
_APART = 1e-3
_SMOOTH_VIOLATION, _OTHER_VIOLATION = 1e-8, 1e-5
_SMOOTH_DRIFT, _OTHER_DRIFT = 1e-6, 1e-3


@dataclass(frozen=True)
class Effort:
    """How much is done for a certificate.

    Attributes:
        intervals: of the coarsest direct grid, and of the conditions checked on a grid.
        starts: random starts in the search for something cheaper.
        seed: of these.
        enumerate: whether extremals are enumerated where that is possible.
    """

    intervals: int = 40
    starts: int = 5
    seed: int = 0
    enumerate: bool = True

    def __post_init__(self) -> None:
        """Check the numbers."""
        whole(self.intervals, "certify: intervals")
        whole(self.starts, "certify: starts")
        whole(self.seed, "certify: seed", least=0)


def certify(solution: Solution, effort: Effort | None = None) -> Certificate:
    """Certify the optimal value of the problem that a solution solves.

    Methods that share nothing but the problem are taken to the end, as far as they apply:
    indirect multiple shooting, refined collocation, direct multiple shooting extrapolated over
    its grids; in discrete time the nonlinear program and a linear method. The first two have
    to agree to 8 digits where an extremal is one of them, to 5 where not, and to a thousandth of
    the cost itself. Then the referee's word on the trajectory, the Hamiltonian, the second-order
    test, the Karush-Kuhn-Tucker conditions on a grid, and what can be said of the optimum being
    the global one.

    Args:
        solution: near the optimum that is to be certified; of any method.
        effort: default ``Effort()``.

    Returns:
        the certificate; it says itself whether it holds, and what was not checked.

    Raises:
        UnsupportedProblem: if direct multiple shooting solves the problem on no grid.
    """
    effort = effort or Effort()
    instance(solution, Solution, "certify: solution")
    instance(effort, Effort, "certify: effort")
    try:
        coarse = on_grid(solution, effort.intervals)
    except NoEstimateError as reason:
        raise UnsupportedProblem(f"{solution.problem.name}: no grid solves it. {reason}") from None
    estimates, silent = _estimates(solution, coarse)
    if not estimates:
        why = " ".join(check.sentence for check in silent)
        raise UnsupportedProblem(f"{solution.problem.name}: no method certifies it. {why}")
    best = estimates[0]
    smooth = best.is_extremal
    on_the_grid = grid_checks(coarse)
    checks = [
        _agreement(estimates, smooth),
        _relative_agreement(estimates),
        *silent,
        _feasibility(best, smooth),
        _hamiltonian(best, unique=on_the_grid[0].verdict is Verdict.HOLDS),
        _second_order(best),
        *on_the_grid,
        *_global(best, effort, len(coarse.t) - 1),
    ]
    return Certificate(solution.problem.name, tuple(estimates), tuple(checks))


def _estimates(solution: Solution, coarse: Solution) -> tuple[list[Estimate], list[Check]]:
    """What the methods say, an extremal first, then the most accurate; and why others do not.

    Doubled grids of direct shooting are asked only where another method is missing: they are
    the least accurate.
    """
    methods: dict[str, Callable[[], Estimate]] = {
        "polish": lambda: by_polish(solution),
        "collocation": lambda: by_collocation(coarse),
        "doubled grids": lambda: by_shooting(coarse),
    }
    if solution.problem.model.is_discrete:
        methods = {
            "nonlinear program": lambda: by_nonlinear_program(coarse),
            "linear method": lambda: by_linear_method(coarse),
        }
    found: list[Estimate] = []
    silent: list[Check] = []
    for name, method in methods.items():
        if len(found) == _METHODS:
            break
        try:
            found.append(method())
        except NoEstimateError as reason:
            silent.append(Check.skipped(name, str(reason)))
    found.sort(key=lambda estimate: (not estimate.is_extremal, estimate.error))
    return found, silent


def _global(best: Estimate, effort: Effort, intervals: int) -> list[Check]:
    """What can be said of the optimum being the global one."""
    reason = other_data(best.solution)
    if reason:
        return [Check.skipped(name, reason) for name in (CONVEXITY, STARTS, EXTREMALS)]
    return [
        convexity(best.solution.problem),
        other_starts(best, effort.starts, effort.seed, intervals),
        every_extremal(best) if effort.enumerate else Check.skipped(EXTREMALS, "not asked for"),
    ]


def _agreement(estimates: list[Estimate], smooth: bool) -> Check:
    if len(estimates) < _METHODS:
        return Check(AGREEMENT, Verdict.FAILS, "one method only")
    first, second = estimates
    digits, asked = agreement(first.cost, second.cost), SMOOTH_DIGITS if smooth else OTHER_DIGITS
    said = f"{digits:.1f} digits between {first.method} and {second.method}; {asked} asked"
    verdict = Verdict.HOLDS if digits >= asked else Verdict.FAILS
    return Check(AGREEMENT, verdict, said, digits, asked)


def _relative_agreement(estimates: list[Estimate]) -> Check:
    """Tolerances are absolute below 1: methods that see next to no cost agree on any trajectory."""
    if len(estimates) < _METHODS:
        return Check.skipped(RELATIVE, "one method only")
    first, second = estimates
    apart, size = abs(first.cost - second.cost), abs(first.cost)
    said = f"{apart:.1e} apart at a cost of {size:.1e}"
    if apart > _APART * size:
        said += ": too small for the tolerances, state it in smaller units"
    return Check.at_most(RELATIVE, apart, _APART * size, said)


def _feasibility(best: Estimate, smooth: bool) -> Check:
    limit = _SMOOTH_VIOLATION if smooth else _OTHER_VIOLATION
    said = f"the referee sees a violation of {best.violation:.1e}"
    return Check.at_most(FEASIBILITY, best.violation, limit, said)


def _hamiltonian(best: Estimate, unique: bool) -> Check:
    """Decisive where the costates are unique, which those of a direct method need not be."""
    check = hamiltonian_check(best.solution, _SMOOTH_DRIFT if best.is_extremal else _OTHER_DRIFT)
    return check if best.is_extremal or unique else replace(check, decisive=False)


def _second_order(best: Estimate) -> Check:
    """The word of ``polish``: no conjugate point."""
    if not best.is_extremal:
        return Check.skipped(SECOND_ORDER, "no extremal to test: see the curvature on the grid")
    if best.solution.status is Status.SOLVED:
        return Check(SECOND_ORDER, Verdict.HOLDS, "H_uu > 0 and no conjugate point")
    if best.solution.problem.has_free_time:
        return Check.skipped(SECOND_ORDER, best.solution.message)
    return Check(SECOND_ORDER, Verdict.FAILS, best.solution.message)
