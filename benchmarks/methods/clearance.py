"""Methods that keep a hard clearance, each started from the soft optimum of its scenario."""

from collections.abc import Callable
from functools import lru_cache

from benchmarks.cases import Case, soft_optimum
from benchmarks.methods.method import Method, Outcome, Settings
from ocp import OCP, Solver, evaluate, solve
from solvers import AugmentedLagrangian, BetweenNodes, IndirectShooting, MultipleShooting, Schuetz

_INTERVALS = 75
# A large penalty makes the canonical flow stiff: a segment an interval, four steps a segment.
_INNER = {
    "direct": MultipleShooting(_INTERVALS),
    "schuetz": Schuetz.sound(intervals=_INTERVALS),
    "indirect": IndirectShooting(segments=_INTERVALS, steps=4 * _INTERVALS),
}
# Where the effort alone is the cost, a low first penalty lets the arm back into the disc.
_SUITES = (("clearance", "", 1e2), ("clearance-radius", "-firm", 1e5))


@lru_cache(maxsize=2)
def _problem(case: Case) -> OCP:
    return case.build()


def _run(solver: Solver) -> Callable[[Case, Settings], Outcome]:
    """The solver from the soft optimum; the local gap is that to direct shooting from there."""

    def run(case: Case, settings: Settings) -> Outcome:
        start = soft_optimum(case.name.rsplit("-", 1)[0])
        solution = solve(_problem(case), solver, guess=start)
        verdict = evaluate(solution)
        if isinstance(solver, BetweenNodes) or not solution.status.is_success:
            return Outcome(solution, verdict)
        below = solve(_problem(case), BetweenNodes(MultipleShooting(_INTERVALS)), guess=solution)
        if not below.status.is_success:
            return Outcome(solution, verdict)
        return Outcome(solution, verdict, verdict.cost / evaluate(below).cost - 1.0)

    return run


def clearance_methods() -> tuple[Method, ...]:
    """Return the direct method and the augmented Lagrangian over three inner solvers."""
    direct = BetweenNodes(MultipleShooting(_INTERVALS))
    both = frozenset(suite for suite, _, _ in _SUITES)
    about = "margins until the referee agrees"
    methods = [Method("hard-direct", "clearance", both, _run(direct), repr(direct), about)]
    for suite, suffix, penalty in _SUITES:
        for name, inner in _INNER.items():
            solver = AugmentedLagrangian(inner, intervals=_INTERVALS, penalty=penalty)
            title, about = f"lagrangian-{name}{suffix}", f"multipliers, penalty from {penalty:g}"
            here = frozenset({suite})
            methods.append(Method(title, "clearance", here, _run(solver), repr(solver), about))
    return tuple(methods)
