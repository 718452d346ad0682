"""One tuple of solvers, every case that declares the family: gap and violation, by the referee."""

from functools import cache

import numpy as np
import pytest

from benchmarks.cases import TEXTBOOK, Case, Family, arm_cases
from ocp import Solution, Solver, Status, evaluate, solve
from solvers import (
    Collocation,
    IndirectShooting,
    MultipleShooting,
    Schuetz,
    StagewiseNewton,
    polish,
)
from tests.tolerances import BELOW, GAP, VIOLATION

SOLVERS: tuple[tuple[Family, Solver], ...] = (
    ("direct", MultipleShooting()),
    ("direct", MultipleShooting(backend="fatrop")),
    # 3 divides 24 as it divides 75: the ends of Bryson-Denham's arc are edges.
    ("direct", Collocation(24)),
    ("direct", Collocation(24, points="gauss")),
    ("gradient", Schuetz.sound()),
    ("gradient", StagewiseNewton()),
    ("indirect", IndirectShooting(segments=1)),
    ("indirect", IndirectShooting(segments=15)),
)
QUICK = {"arm-001-sum", "arm-001-closest", "arm-003-sum"}
SLOW = {f"arm-{i:03d}-{cost}" for i in (1, 2, 3, 4, 7, 15, 28) for cost in ("sum", "closest")}
SLOW -= QUICK
CASES = (*TEXTBOOK, *(c for c in arm_cases() if c.name in QUICK | SLOW))

# case -> its own (gap, violation), with the reason.
EXCEPTIONS: dict[tuple[str, Family], tuple[float, float]] = {
    # 40 s with a boundary layer at both ends, 0.1 s an interval (see INTERVALS).
    ("hypersensitive", "direct"): (5e-3, 1e-4),
    # The same with 300 steps: RK4 of 0.13 s. `polish` to an accuracy is in test_agreement.
    ("hypersensitive", "polish"): (1e-3, 1e-2),
}
# Where 75 intervals are too coarse for the integrator.
INTERVALS = {"hypersensitive": 400}
# Why a solver that belongs to the family is not run on a case.
SKIPS: dict[tuple[str, Solver], str] = {
    ("rayleigh", IndirectShooting(segments=1)): (
        "single shooting meets NaN at once, from the right costates too"
    ),
}


@cache
def start_of(case: Case) -> Solution:
    """The direct answer that indirect methods begin with."""
    return solve(case.build(), MultipleShooting(INTERVALS.get(case.name, 75)))


def judge(case: Case, family: Family, solution: Solution) -> None:
    gap_limit, violation_limit = EXCEPTIONS.get(
        (case.name, family), (GAP[family], VIOLATION[family])
    )
    verdict = evaluate(solution)
    gap = case.gap(verdict.cost)
    assert solution.status.is_success, solution.message
    assert gap is not None
    assert gap <= gap_limit
    assert verdict.violation <= violation_limit, verdict.worst
    # What violates nothing cannot cost less than the minimum.
    assert verdict.violation > 0.0 or gap >= -BELOW


def marked(case: Case, label: str, *values: object):
    marks = [pytest.mark.slow, pytest.mark.over_library] if case.name in SLOW else []
    return pytest.param(case, *values, id=f"{case.name}-{label}", marks=marks)


def label_of(solver: Solver) -> str:
    match solver:
        case IndirectShooting(segments=segments):
            variant = f"-{segments}"
        case MultipleShooting(backend="fatrop"):
            variant = "-fatrop"
        case Collocation(points=points):
            variant = f"-{points}"
        case _:
            variant = ""
    return f"{type(solver).__name__}{variant}"


@pytest.mark.many
@pytest.mark.parametrize(
    ("case", "family", "solver"),
    [
        marked(case, label_of(solver), family, solver)
        for case in CASES
        for family, solver in SOLVERS
        if family in case.families
    ],
)
def test_solver_on_case(case: Case, family: Family, solver: Solver) -> None:
    if reason := SKIPS.get((case.name, solver)):
        pytest.skip(reason)
    if isinstance(solver, MultipleShooting) and case.name in INTERVALS:
        solver = MultipleShooting(INTERVALS[case.name], backend=solver.backend)
    if isinstance(solver, Collocation) and case.name in INTERVALS:
        solver = Collocation(INTERVALS[case.name] // 4, points=solver.points)
    guess = start_of(case) if family == "indirect" else None
    judge(case, family, solve(case.build(), solver, guess=guess))


@pytest.mark.many
@pytest.mark.parametrize(
    "case", [marked(case, "polish") for case in CASES if "polish" in case.families]
)
def test_polish_on_case(case: Case) -> None:
    solution = polish(start_of(case))
    assert solution.status is Status.SOLVED, solution.message
    judge(case, "polish", solution)
    rounds = 1 + np.log2((len(solution.t) - 1) / 300)
    assert solution.iterations <= 3 * rounds


def test_every_family_is_swept() -> None:
    families = {family for case in CASES for family in case.families}
    # Two more are methods of the library, which has tests of its own.
    assert families == {family for family, _ in SOLVERS} | {"polish", "between", "collocation"}
    assert len(CASES) == len(TEXTBOOK) + len(QUICK | SLOW)
