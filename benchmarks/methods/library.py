"""The methods of the suite ``library``, each from the problem's own guess or the direct answer."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from benchmarks.cases import Case, Family
from benchmarks.methods.library_tolerances import INTERVALS, USUAL
from benchmarks.methods.method import Method, Outcome, Settings, judged, problem
from ocp import Solution, Solver, solve
from solvers import (
    BetweenNodes,
    Collocation,
    IndirectShooting,
    MultipleShooting,
    Schuetz,
    StagewiseNewton,
    polish,
    refine_mesh,
)

SUITE = "library"
# Polished until the cost changes by less, relative to 1 + cost.
ACCURACY = 1e-10
# Collocation: the first mesh, fine enough for the ends of constrained arcs; the accepted defect.
_FIRST_INTERVALS, DEFECT = 36, 1e-8
FIRST_MESH = Collocation(intervals=_FIRST_INTERVALS)


def _grids(case: Case) -> tuple[int, int]:
    return INTERVALS.get(case.difficulty, USUAL)


@lru_cache(maxsize=64)  # the whole library, for all methods of one process
def _coarse(case: Case) -> Solution:
    """The direct answer that other methods begin with."""
    return solve(problem(case), MultipleShooting(_grids(case)[0]))


def _direct_coarse(case: Case, settings: Settings) -> Outcome:
    return judged(_coarse(case))


def _direct_fine(case: Case, settings: Settings) -> Outcome:
    return judged(solve(problem(case), MultipleShooting(_grids(case)[1]), guess=_coarse(case)))


def _on_coarse(make: Callable[[int], Solver]) -> Callable[[Case, Settings], Outcome]:
    """A solver on the coarse grid, from the problem's own guess."""

    def run(case: Case, settings: Settings) -> Outcome:
        return judged(solve(problem(case), make(_grids(case)[0])))

    return run


def _indirect(case: Case, settings: Settings) -> Outcome:
    return judged(solve(problem(case), IndirectShooting(segments=15), guess=_coarse(case)))


def _collocation(case: Case, settings: Settings) -> Outcome:
    instants = {float(time) for m in problem(case).data for time in np.asarray(m.times)}
    first = replace(FIRST_MESH, intervals=max(_FIRST_INTERVALS, len(instants) + 1))
    return judged(refine_mesh(_coarse(case), solver=first, accuracy=DEFECT).solution)


def _extremal(case: Case, settings: Settings) -> Outcome:
    return judged(polish(_coarse(case), accuracy=ACCURACY))


def _fatrop(intervals: int) -> Solver:
    return MultipleShooting(intervals, backend="fatrop")


def _between(intervals: int) -> Solver:
    return BetweenNodes(MultipleShooting(intervals))


def _gradient(intervals: int) -> Solver:
    return Schuetz.sound(intervals=intervals)


def library_methods() -> tuple[Method, ...]:
    """Return the methods, in the order of the tables; nothing in them is random."""

    def method(name: str, family: Family, run: Callable, solver: object, about: str) -> Method:
        return Method(name, family, frozenset({SUITE}), run, repr(solver), about)

    coarse, fine = (MultipleShooting(n) for n in USUAL)
    shooting, after = IndirectShooting(segments=15), "from direct-coarse"
    gradient, between = _gradient(USUAL[0]), _between(USUAL[0])
    newton = StagewiseNewton(USUAL[0])
    fatrop, settings = _fatrop(USUAL[0]), f"polish, accuracy {ACCURACY:g}"
    return (
        method("direct-coarse", "direct", _direct_coarse, coarse, "own guess"),
        method("direct-fine", "direct", _direct_fine, fine, after),
        method("direct-fatrop", "direct", _on_coarse(_fatrop), fatrop, "own guess"),
        method(
            "collocation", "collocation", _collocation, FIRST_MESH, "refined, from direct-coarse"
        ),
        method("direct-between", "between", _on_coarse(_between), between, "margins, own guess"),
        method("indirect", "indirect", _indirect, shooting, after),
        method("extremal", "polish", _extremal, settings, "direct-coarse made extremal"),
        # On the cases that declare steepest descent: no constraints but bounds of the controls.
        method("newton", "gradient", _on_coarse(StagewiseNewton), newton, "own guess"),
        method("gradient", "gradient", _on_coarse(_gradient), gradient, "own guess"),
    )
