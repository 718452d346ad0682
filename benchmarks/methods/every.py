"""What is compared: each method is a solver with the start it is given."""

from collections.abc import Callable
from functools import lru_cache
from time import perf_counter

from benchmarks.cases import Case, Family
from benchmarks.methods.clearance import clearance_methods
from benchmarks.methods.library import library_methods
from benchmarks.methods.method import Method, Outcome, Settings, judged, problem
from benchmarks.methods.thesis import SHOOTING_STEPS, THESIS_GUESS, thesis_methods
from ocp import Guess, Solution, Solver, Status, solve
from solvers import (
    FixedStep,
    IndirectShooting,
    LocalOptimum,
    MultipleShooting,
    Schuetz,
    enumerate_extremals,
    multistart,
    polish,
)

INTERVALS = 75
# Of the roots that a scan finds, the cheapest are made exact: the optimum is among them.
ROOTS = 12


@lru_cache(maxsize=4)
def _best_direct(case: Case, settings: Settings) -> LocalOptimum | None:
    """The best of several direct starts; several methods begin where it ends."""
    found = multistart(problem(case), MultipleShooting(INTERVALS), settings.starts, settings.seed)
    return found[0] if found else None


def _plain(solver: Solver, guess: Guess | None = None) -> Callable[[Case, Settings], Outcome]:
    """The solver from a fixed first guess."""

    def run(case: Case, settings: Settings) -> Outcome:
        return judged(solve(problem(case), solver, guess=guess))

    return run


def _from_direct(solver: Solver) -> Callable[[Case, Settings], Outcome]:
    """The solver from the best direct answer."""

    def run(case: Case, settings: Settings) -> Outcome:
        best = _best_direct(case, settings)
        return judged(solve(problem(case), solver, guess=best.solution if best else None))

    return run


def _multistart(case: Case, settings: Settings) -> Outcome:
    best = _best_direct(case, settings)
    if best is None:
        return _plain(MultipleShooting(INTERVALS))(case, settings)
    return judged(best.solution)


def _polish(case: Case, settings: Settings) -> Outcome:
    return judged(polish(_multistart(case, settings).solution))


def _cheapest_extremal(case: Case, settings: Settings) -> Outcome:
    """The best of the extremals that a scan finds, with the effort of all; nothing is random."""
    started = perf_counter()
    found = enumerate_extremals(problem(case), keep=ROOTS)
    effort = {
        "solve_time": perf_counter() - started,
        "iterations": found.iterations,
        "work": found.work,
    }
    if not found.solutions:
        none = solve(problem(case), MultipleShooting(INTERVALS))
        reason = "the scan found no extremal"
        return judged(none.with_(status=Status.FAILED, message=reason, **effort))
    return judged(found.solutions[0].with_(**effort))


def _with_local_gap(solver: Solver) -> Callable[[Case, Settings], Outcome]:
    """The solver from zero controls, compared with the bottom of its own basin."""

    def run(case: Case, settings: Settings) -> Outcome:
        outcome = _plain(solver)(case, settings)
        bottom = _plain_from(MultipleShooting(INTERVALS), case, outcome.solution)
        if not bottom.solution.status.is_success:
            return outcome
        gap = outcome.verdict.cost / bottom.verdict.cost - 1.0
        return Outcome(outcome.solution, outcome.verdict, gap)

    return run


def _plain_from(solver: Solver, case: Case, start: Solution) -> Outcome:
    return judged(solve(problem(case), solver, guess=start))


def _method(
    name: str,
    family: Family,
    suites: str,
    run: Callable[[Case, Settings], Outcome],
    solver: Solver,
    about: str,
) -> Method:
    return Method(name, family, frozenset(suites.split()), run, repr(solver), about)


def all_methods() -> tuple[Method, ...]:
    """Return every method, in the order of the tables."""
    return (
        *_direct_methods(),
        *_gradient_methods(),
        *_single_shooting(),
        *_multiple_shooting(),
        *clearance_methods(),
        *thesis_methods(),
        *library_methods(),
    )


def _direct_methods() -> tuple[Method, ...]:
    coarse, fine = MultipleShooting(INTERVALS), MultipleShooting(2 * INTERVALS)
    fatrop = MultipleShooting(INTERVALS, backend="fatrop")
    extremal = IndirectShooting(segments=15)
    suites, after = "arm", "from direct-75"
    return (
        _method(
            "direct-75", "direct", f"{suites} comparison", _multistart, coarse, "best of the starts"
        ),
        _method("direct-150", "direct", suites, _from_direct(fine), fine, after),
        _method("fatrop-75", "direct", suites, _plain(fatrop), fatrop, "own start"),
        _method("polish", "polish", "arm", _polish, extremal, "direct-75 made extremal"),
        _method("extremals", "polish", "arm", _cheapest_extremal, extremal, "cheapest of a scan"),
    )


def _gradient_methods() -> tuple[Method, ...]:
    thesis, sound = Schuetz(step=FixedStep(0.01)), Schuetz.sound(intervals=INTERVALS)
    suites = "arm comparison"
    return (
        _method("schuetz", "gradient", "arm", _with_local_gap(thesis), thesis, "Algorithm 2"),
        _method("schuetz-sound", "gradient", suites, _with_local_gap(sound), sound, "from zero"),
    )


def _single_shooting() -> tuple[Method, ...]:
    damped = IndirectShooting(steps=SHOOTING_STEPS)
    undamped = IndirectShooting(steps=SHOOTING_STEPS, damped=False)
    varied = IndirectShooting(steps=SHOOTING_STEPS, jacobian="finite-difference")
    thesis = Guess(costate=THESIS_GUESS)

    def method(name: str, suites: str, solver: Solver, guess: Guess | None, about: str) -> Method:
        return _method(name, "indirect", suites, _plain(solver, guess), solver, about)

    return (
        method("shooting", "arm links", damped, None, "psi(t0) = 0, damped"),
        method("shooting-fd", "arm links", varied, None, "psi(t0) = 0, damped, Algorithm 1"),
        method("shooting-undamped", "arm", undamped, None, "psi(t0) = 0, (3.50) as it stands"),
        method("shooting-thesis", "arm", damped, thesis, "psi(t0) = (0, 10, -10), damped"),
        method("shooting-thesis-undamped", "arm", undamped, thesis, "psi(t0) = (0, 10, -10)"),
    )


def _multiple_shooting() -> tuple[Method, ...]:
    exact = IndirectShooting(segments=15)
    varied = IndirectShooting(segments=15, jacobian="finite-difference")

    def method(name: str, suites: str, solver: Solver, about: str) -> Method:
        return _method(name, "indirect", suites, _from_direct(solver), solver, about)

    return (
        method("indirect-15", "arm links comparison", exact, "15 segments, from direct-75"),
        method("indirect-15-fd", "arm links", varied, "15 segments, from direct-75, Algorithm 1"),
    )
