"""Certify an optimal value: independent methods, and every condition that can be checked."""

from collections.abc import Callable
from dataclasses import replace

from ocp import (
    Interrupted,
    PhasesSolution,
    Progress,
    Solution,
    UnsupportedProblem,
    evaluate,
)
from ocp.internal import InNormalForm, check_instance, normal_form, told
from solvers.certify.by_arcs import by_arcs
from solvers.certify.certificate import CONVEXITY, STARTS, Certificate, Check, Estimate, Verdict
from solvers.certify.discrete_estimates import by_linear_method, by_nonlinear_program
from solvers.certify.effort import CertifyOptions, Clock
from solvers.certify.estimate_checks import (
    FEASIBILITY,
    METHODS,
    OTHER_VIOLATION,
    agreement_check,
    feasibility,
    kept_hamiltonian,
    most_violated,
    relative_agreement,
    second_order,
)
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
from solvers.certify.of_phases import with_phases
from solvers.collocation.collocation import Collocation
from solvers.direct.multiple_shooting import MultipleShooting

_AS_WRITTEN = "as written"
# Costs of a problem and its normal form differ by less, relative to the larger of it and 1.
_SAME_COST = 1e-8


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
        return with_phases(found, solution, most_violated(found.estimates[0].is_extremal))
    form = normal_form(solution.problem)
    if form is not None:
        return _in_terms_of_the_user(solution, effort, InNormalForm(form), progress)
    clock = Clock.started(effort.seconds, report)
    try:
        found = _certified(solution, effort, clock)
    except KeyboardInterrupt:
        raise Interrupted("certify", tuple(clock.estimates)) from None
    clock.end()
    return found


def _certified(solution: Solution, effort: CertifyOptions, clock: Clock) -> Certificate:
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
        agreement_check(estimates, smooth),
        relative_agreement(estimates),
        *silent,
        feasibility(best, smooth),
        kept_hamiltonian(best, unique=on_the_grid[0].verdict is Verdict.HOLDS),
        second_order(best),
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
        within += OTHER_VIOLATION * sum(peak.weight for peak in best.solution.problem.peaks)
    said = f"the referee's costs of problem and normal form differ by {apart:.1e}"
    feasible = feasibility(replace(best, violation=verdict.violation), best.is_extremal)
    checks = [
        Check.at_most(f"{_AS_WRITTEN}, cost", apart, within, said),
        replace(feasible, name=f"{_AS_WRITTEN}, {FEASIBILITY}"),
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
    solution: Solution, coarse: Solution, clock: Clock
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
        if len(found) == METHODS:
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
    clock: Clock,
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
