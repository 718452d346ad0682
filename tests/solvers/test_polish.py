"""Polish: starts again from a finer grid, refines to an accuracy, and says where it could not."""

import sys

import pytest

from benchmarks.cases import TEXTBOOK, Case, arm_cases
from ocp import Solution, Status, solve
from solvers import IndirectShooting, MultipleShooting, polish


def case_called(name: str) -> Case:
    (case,) = [case for case in (*TEXTBOOK, *arm_cases()) if case.name == name]
    return case


def held(case: Case) -> Solution:
    return solve(case.build(), MultipleShooting(75))


def test_starts_again_from_a_finer_grid_where_newton_fails() -> None:
    direct = held(case_called("arm-024-sum"))
    plain = solve(direct.problem, IndirectShooting(segments=15), guess=direct)
    assert plain.status is Status.NO_PROGRESS
    extremal = polish(direct)
    assert extremal.status is Status.SOLVED
    # Both tries are counted.
    assert extremal.iterations > plain.iterations
    assert extremal.work.rollouts > plain.work.rollouts


def test_reaches_an_accuracy_from_an_inaccurate_start() -> None:
    case = case_called("hypersensitive")
    direct = held(case)
    assert direct.status is Status.INACCURATE
    extremal = polish(direct, accuracy=1e-8)
    assert extremal.status is Status.SOLVED
    gap = case.gap(extremal.cost)
    assert gap is not None
    assert abs(gap) < 1e-8


def test_says_when_the_steps_run_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["solvers.polish"], "_MOST_STEPS", 700)
    extremal = polish(held(case_called("rayleigh")), accuracy=1e-13)
    assert extremal.status is Status.INACCURATE
    assert extremal.message == "the cost still changes by more than 1e-13 at 600 steps"
