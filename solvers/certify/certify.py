"""Certify an optimal value: independent methods, and every condition that can be checked."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from ocp import (
    Interrupted,
    PhasesSolution,
    Progress,
    Solution,
    Status,
    UnsupportedProblem,
    evaluate,
)
from ocp.internal import (
    InNormalForm,
    check_flag,
    check_instance,
    check_positive,
    check_whole,
    normal_form,
    told,
)
from solvers.certify.by_arcs import by_arcs
from solvers.certify.certificate import (
    AGREEMENT,
    CONVEXITY,
    STARTS,
    Certificate,
    Check,
    Estimate,
    Verdict,
    agreement,
)
from solvers.certify.discrete_estimates import by_linear_method, by_nonlinear_program
from solvers.certify.estimates import (
    NoEstimateError,
    by_collocation,
    by_polish,
    by_shooting,
    on_grid,
    on_points,
)
from solvers.certify.global_evidence import (
    EXTREMALS,
    convexity,
    every_extremal,
    other_data,
    other_starts,
)
from solvers.certify.grid_conditions import CHECKS as GRID
from solvers.certify.grid_conditions import grid_checks
from solvers.certify.hamiltonian_check import hamiltonian_check
from solvers.certify.of_phases import with_phases
from solvers.collocation.collocation import Collocation
from solvers.direct.multiple_shooting import MultipleShooting

# So many independent methods are compared.
_METHODS = 2
# What a certificate begins one after the other: a direct answer, methods and groups of checks.
_STAGES = 6
RELATIVE = "relative agreement"
FEASIBILITY, SECOND_ORDER = "feasibility", "second order"
AS_WRITTEN = "as written"
# Costs of a problem and its normal form differ by less, relative to the larger of it and 1.
_SAME_COST = 1e-8
# Digits asked of two methods: where no path constraint is active, and where one is.
SMOOTH_DIGITS, OTHER_DIGITS = 8, 5
# Digits count from 1; of a smaller cost itself two methods may differ by this share.
_APART = 1e-3
_SMOOTH_VIOLATION, _OTHER_VIOLATION = 1e-8, 1e-5
_SMOOTH_DRIFT, _OTHER_DRIFT = 1e-6, 1e-3


@dataclass(frozen=True)
class CertifyOptions:
    """How much is done for a certificate.

    Attributes:
        intervals: of the coarsest direct grid, and of the conditions checked on a grid.
        starts: random starts in the search for something cheaper.
        seed: of these.
        enumerate: whether extremals are enumerated where that is possible.
        seconds: after so many no further method and no further check is begun; what has begun
            is finished, and methods are tried until one has answered. What was left out counts
            as not checked.
    """

    intervals: int = 40
    starts: int = 5
    seed: int = 0
    enumerate: bool = True
    seconds: float = np.inf

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_whole(self.intervals, "certify: intervals")
        check_whole(self.starts, "certify: starts")
        check_whole(self.seed, "certify: seed", least=0)
        check_flag(self.enumerate, "certify: enumerate")
        check_positive(self.seconds, "certify: seconds", finite=False)


@dataclass(frozen=True)
class _Clock:
    """The time limit, and what is told on the way."""

    seconds: float
    begun: float
    report: Progress
    estimates: list[Estimate] = field(default_factory=list)
    _stages: list[str] = field(default_factory=list)

    @property
    def known(self) -> str:
        """The values that are known, in words."""
        return ", ".join(f"{e.cost:.9g} by {e.method.partition(',')[0]}" for e in self.estimates)

    def begin(self, stage: str) -> None:
        """Tell that a stage begins."""
        said = f"{stage}; {self.known}" if self.estimates else stage
        self.report(min(len(self._stages), _STAGES - 1), _STAGES, said)
        self._stages.append(stage)

    @property
    def is_late(self) -> bool:
        """Whether the time limit is reached."""
        return perf_counter() - self.begun > self.seconds

    def checks(self, names: Sequence[str], make: Callable[[], Sequence[Check]]) -> list[Check]:
        """Make some checks, or return that there was no time for them."""
        if self.is_late:
            return [self.left_out(name) for name in names]
        self.begin(", ".join(names))
        return list(make())

    def left_out(self, name: str) -> Check:
        """Return a check that was not made for lack of time."""
        return Check.skipped(name, f"left out: the {self.seconds:g} s it was given were over")


def certify(
    solution: Solution | PhasesSolution,
    effort: CertifyOptions | None = None,
    *,
    progress: Progress | None = None,
) -> Certificate:
    """Certify the optimal value of the problem that a solution solves.

    Methods that differ in what they discretise and solve are taken to the end, as far as they
    apply: indirect multiple shooting, refined collocation, shooting over the arcs that it shows,
    direct multiple shooting extrapolated over its grids (where dynamics are too stiff for that,
    collocation on other points); in discrete time the nonlinear program and a linear method. They
    share the problem's description, its derivatives (CasADi), a direct answer to start from, for
    most of them the interior-point method, and the referee who says what their answers cost. The
    first two have to agree to 8 digits where an extremal is one of them, to 5 where not, and to a
    thousandth of the cost itself. Then the referee's word on the trajectory, the Hamiltonian, the
    second-order test, the Karush-Kuhn-Tucker conditions on a grid, and what can be said of the
    optimum being the global one.

    Args:
        solution: near the optimum that is to be certified; of any method. Of ``Phases`` the
            certificate is that of all side by side, and its solution that one's.
        effort: default ``CertifyOptions()``.
        progress: told before each method and check, with the values that are known.

    Returns:
        the certificate; it says itself whether it holds, and what was not checked.

    Raises:
        UnsupportedProblem: if neither direct multiple shooting nor collocation solves the problem,
            or no method answers.
        Interrupted: on Ctrl-C; its ``so_far`` are the estimates that were made.
    """
    report = told(progress, "certify")
    effort = effort or CertifyOptions()
    if not isinstance(solution, PhasesSolution):
        check_instance(solution, Solution, "certify: solution")
    check_instance(effort, CertifyOptions, "certify: effort")
    if isinstance(solution, PhasesSolution):
        found = certify(solution.whole, effort, progress=progress)
        smooth = found.estimates[0].is_extremal
        return with_phases(found, solution, _SMOOTH_VIOLATION if smooth else _OTHER_VIOLATION)
    form = normal_form(solution.problem)
    if form is not None:
        return _in_terms_of_the_user(solution, effort, InNormalForm(form), progress)
    clock = _Clock(effort.seconds, perf_counter(), report)
    try:
        found = _certified(solution, effort, clock)
    except KeyboardInterrupt:
        raise Interrupted("certify", tuple(clock.estimates)) from None
    report(_STAGES, _STAGES, clock.known)
    return found


def _certified(solution: Solution, effort: CertifyOptions, clock: "_Clock") -> Certificate:
    """Certify a problem in its normal form."""
    clock.begin("a direct answer")
    coarse, stiff = _coarse(solution, effort)
    estimates, silent = _estimates(solution, coarse, clock)
    if not estimates:
        why = "; ".join(f"{check.name}: {check.sentence}" for check in silent)
        raise UnsupportedProblem(f"{solution.problem.name}: no method certifies it. {why}")
    best = estimates[0]
    smooth = best.is_extremal
    on_the_grid = [Check.skipped(name, stiff) for name in GRID]
    if not stiff:
        on_the_grid = clock.checks(GRID, lambda: grid_checks(coarse))
    checks = [
        _agreement(estimates, smooth),
        _relative_agreement(estimates),
        *silent,
        _feasibility(best, smooth),
        _hamiltonian(best, unique=on_the_grid[0].verdict is Verdict.HOLDS),
        _second_order(best),
        *on_the_grid,
        *_global(best, effort, _searching(effort, coarse), clock),
    ]
    return Certificate(solution.problem.name, tuple(estimates), tuple(checks))


def _in_terms_of_the_user(
    solution: Solution,
    effort: CertifyOptions,
    rewriting: InNormalForm,
    progress: Progress | None,
) -> Certificate:
    """Certify the normal form, and ask the referee for the problem as it is written."""
    found = certify(rewriting.written(solution), effort, progress=progress)
    estimates = [replace(e, solution=rewriting.answer(e.solution)) for e in found.estimates]
    best = estimates[0]
    verdict, normal = evaluate(best.solution), evaluate(found.solution)
    apart = abs(verdict.cost - normal.cost)
    within = _SAME_COST * max(1.0, abs(verdict.cost))
    if not best.is_extremal:  # a peak is known as well as rows are met
        within += _OTHER_VIOLATION * sum(peak.weight for peak in best.solution.problem.peaks)
    said = f"the referee's costs of problem and normal form differ by {apart:.1e}"
    feasible = _feasibility(replace(best, violation=verdict.violation), best.is_extremal)
    checks = [
        Check.at_most(f"{AS_WRITTEN}, cost", apart, within, said),
        replace(feasible, name=f"{AS_WRITTEN}, {FEASIBILITY}"),
    ]
    return replace(found, estimates=tuple(estimates), checks=(*found.checks, *checks))


def _coarse(solution: Solution, effort: CertifyOptions) -> tuple[Solution, str]:
    """Return a direct answer to start from, and why it is none of shooting where it is none.

    Dynamics that are too fast for the explicit steps of any grid are collocated.

    Raises:
        UnsupportedProblem: if neither solves the problem.
    """
    try:
        return on_grid(solution, effort.intervals), ""
    except NoEstimateError as failure:
        reason = failure
    try:
        found = on_points(solution, effort.intervals)
    except (NoEstimateError, UnsupportedProblem):
        raise UnsupportedProblem(f"{solution.problem.name}: no grid solves it. {reason}") from None
    return found, f"no grid of explicit steps solves it. {reason}"


def _searching(effort: CertifyOptions, coarse: Solution) -> MultipleShooting | Collocation:
    """Return what solves from other starts: what solved from this one."""
    if coarse.control_kind == "held":
        return MultipleShooting(len(coarse.t) - 1)
    return Collocation(effort.intervals)


def _estimates(
    solution: Solution, coarse: Solution, clock: _Clock
) -> tuple[list[Estimate], list[Check]]:
    """What the methods say, an extremal first, then the most accurate; and why others do not.

    Arcs are looked at, and doubled grids of direct shooting asked, only where another method
    is missing: the latter are the least accurate. Time ends the search once one has answered.
    """
    found = clock.estimates
    silent: list[Check] = []
    methods: dict[str, Callable[[], Estimate]] = {
        "polish": lambda: by_polish(solution),
        "collocation": lambda: by_collocation(coarse),
        "arcs": lambda: by_arcs(_piecewise(found)),
        "doubled grids": lambda: by_shooting(coarse),
    }
    if coarse.control_kind != "held":
        methods |= {"doubled grids": lambda: by_collocation(coarse, "gauss")}
    if solution.problem.model.is_discrete:
        methods = {
            "nonlinear program": lambda: by_nonlinear_program(coarse),
            "linear method": lambda: by_linear_method(coarse),
        }
    for name, method in methods.items():
        if len(found) == _METHODS:
            break
        if found and clock.is_late:
            silent.append(clock.left_out(name))
            continue
        clock.begin(name)
        try:
            found.append(method())
        except NoEstimateError as reason:
            silent.append(Check.skipped(name, str(reason)))
    found.sort(key=lambda estimate: (not estimate.is_extremal, estimate.error))
    return list(found), silent


def _piecewise(found: list[Estimate]) -> Solution:
    """The answer of collocation, which alone shows the arcs."""
    for estimate in found:
        if estimate.solution.control_kind == "polynomial":
            return estimate.solution
    raise NoEstimateError("collocation shows none")


def _global(
    best: Estimate,
    effort: CertifyOptions,
    solver: MultipleShooting | Collocation,
    clock: _Clock,
) -> list[Check]:
    """Return the evidence that the optimum is the global one."""
    reason = other_data(best.solution)
    if reason:
        return [Check.skipped(name, reason) for name in (CONVEXITY, STARTS, EXTREMALS)]
    ocp = best.solution.problem
    starts = clock.checks(
        [STARTS], lambda: [other_starts(best, effort.starts, effort.seed, solver)]
    )
    if not effort.enumerate:
        return [convexity(ocp), *starts, Check.skipped(EXTREMALS, "not asked for")]
    return [convexity(ocp), *starts, *clock.checks([EXTREMALS], lambda: [every_extremal(best)])]


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
    """The second-order test of ``polish``: no conjugate point."""
    if not best.is_extremal:
        return Check.skipped(SECOND_ORDER, "no extremal to test: see the curvature on the grid")
    if best.solution.status is Status.SOLVED:
        return Check(SECOND_ORDER, Verdict.HOLDS, "H_uu > 0 and no conjugate point")
    if best.solution.problem.has_free_time:
        return Check.skipped(SECOND_ORDER, best.solution.message)
    return Check(SECOND_ORDER, Verdict.FAILS, best.solution.message)
