"""Polish: starts again from a finer grid, refines to an accuracy, and says where it could not."""

import re
import sys
from dataclasses import replace
from math import inf, nan
from typing import Any, cast

import pytest

from benchmarks.cases import TEXTBOOK, Case, arm_cases
from models.textbook import van_der_pol
from ocp import (
    Box,
    Constraint,
    ProblemError,
    Solution,
    Status,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import IndirectShooting, MultipleShooting, polish
from solvers.indirect.indirect_shooting import IndirectShootingProgram
from solvers.indirect.second_order import SecondOrder
from solvers.indirect.step_halving import change_when_halved, finer
from tests.solvers.problems import saturated_transfer
from tests.tolerances import RESIDUAL


def case_called(name: str) -> Case:
    (case,) = [case for case in (*TEXTBOOK, *arm_cases()) if case.name == name]
    return case


def held(case: Case) -> Solution:
    return solve(case.build(), MultipleShooting(75))


@pytest.mark.slow
def test_starts_again_from_a_finer_grid_where_newton_fails() -> None:
    direct = held(case_called("arm-024-sum"))
    plain = solve(direct.problem, IndirectShooting(segments=15), guess=direct)
    assert plain.status is Status.NO_PROGRESS
    extremal = polish(direct, accuracy=1e-4)
    assert extremal.status is Status.SOLVED
    # Both tries are counted.
    assert extremal.iterations > plain.iterations
    assert extremal.work.rollouts > plain.work.rollouts


def test_a_fine_extremal_starts_again_from_a_grid_of_some_hundred_intervals(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its steps are no intervals: 1200 of them would make 4800."""
    asked, module = [], sys.modules["solvers.polish"]

    def coarse(intervals: int) -> MultipleShooting:
        asked.append(intervals)
        return MultipleShooting(20)

    direct = held(case_called("rayleigh"))
    fine = solve(direct.problem, IndirectShooting(segments=15, steps=1200), guess=direct)
    monkeypatch.setattr(module, "MultipleShooting", coarse)
    assert len(fine.t) == 1201
    out_of_reach = IndirectShooting(segments=15, steps=300, tolerance=1e-300)
    assert not polish(fine, solver=out_of_reach).status.is_success
    assert asked == [600]


@pytest.mark.slow
def test_an_extremal_that_finer_steps_lose_is_inaccurate() -> None:
    """Arm 24 passes its obstacle where the cost's curvature jumps: 300 steps are worth 4 digits."""
    extremal = polish(held(case_called("arm-024-sum")))
    assert extremal.status is Status.INACCURATE
    assert re.match(r"half of its 300 steps would change the cost by 1.\de-04", extremal.message)
    assert "with 600: NO_PROGRESS, residual" in extremal.message
    # What is returned is the extremal that was found.
    assert extremal.residual < RESIDUAL


@pytest.mark.slow
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
    monkeypatch.setattr(sys.modules["solvers.indirect.step_halving"], "_MOST_STEPS", 700)
    extremal = polish(held(case_called("rayleigh")), accuracy=1e-13)
    assert extremal.status is Status.INACCURATE
    assert extremal.message.startswith("half of its 600 steps would change the cost by 1.7e-07")


@pytest.mark.parametrize("limit", [4.5, 4.2])
def test_doubles_the_steps_where_a_control_meets_its_bound(limit: float) -> None:
    """Without being asked: 300 steps leave 1e-5 of the cost and of the end."""
    ocp, cost = saturated_transfer(limit)
    extremal = polish(solve(ocp, MultipleShooting(75)))
    verdict = evaluate(extremal)
    assert extremal.status is Status.SOLVED
    assert len(extremal.t) - 1 > 300
    assert verdict.cost == pytest.approx(cost, rel=1e-6)
    assert verdict.violation < 1e-5


@pytest.mark.parametrize("name", ["rayleigh", "van-der-pol"])
def test_the_change_under_half_the_step_is_predicted(name: str) -> None:
    direct = held(case_called(name))
    program = IndirectShooting(segments=15).prepare(direct.problem)
    half = finer(program)
    extremal, then = program.run(guess=direct), half.run(guess=direct)
    predicted = change_when_halved(extremal, program, half)
    assert predicted.cost == pytest.approx(abs(then.cost - extremal.cost), rel=1e-2)
    assert 0.0 < predicted.state < 1e-5


@pytest.mark.slow
def test_curvature_is_tested_once(monkeypatch: pytest.MonkeyPatch) -> None:
    tested, test = [], IndirectShootingProgram.second_order

    def counted(program: IndirectShootingProgram, solution: Solution) -> SecondOrder:
        tested.append(len(solution.t) - 1)
        return test(program, solution)

    monkeypatch.setattr(IndirectShootingProgram, "second_order", counted)
    extremal = polish(held(case_called("rayleigh")), accuracy=1e-10)
    assert tested == [len(extremal.t) - 1]
    assert tested[0] > 1000


@pytest.mark.parametrize("accuracy", [0.0, -1.0, nan, inf, "fine", None, [1e-8]])
def test_a_bad_accuracy(accuracy: Any) -> None:
    with pytest.raises(ProblemError, match="polish: accuracy"):
        polish(held(case_called("van-der-pol")), accuracy=accuracy)


def test_what_is_no_solution_is_refused_by_name() -> None:
    ocp: Any = case_called("van-der-pol").build()
    with pytest.raises(ProblemError, match="polish: solution is an OCP, Solution is needed"):
        polish(ocp)
    with pytest.raises(ProblemError, match="polish: solver is a MultipleShooting"):
        polish(solve(ocp, MultipleShooting(20)), solver=cast("Any", MultipleShooting()))


def test_inequalities_that_do_not_act_are_left_out_and_named() -> None:
    ocp = van_der_pol()
    far = Constraint("far", ocp.model.x[0] + ocp.model.u, -9.0, 9.0)
    wide = replace(ocp, state_bounds=Box(-5.0, 5.0), constraints=(*ocp.constraints, far))
    polished = polish(solve(wide, MultipleShooting(75)))
    exact = polish(solve(ocp, MultipleShooting(75)))
    assert polished.status is Status.SOLVED
    assert polished.problem is wide
    assert polished.cost == pytest.approx(exact.cost, rel=1e-10)
    assert polished.message == "polished without 'far', state bounds, which do not act"


def test_inequalities_that_act_are_refused() -> None:
    ocp = replace(van_der_pol(), state_bounds=Box(-0.2, 5.0))
    with pytest.raises(UnsupportedProblem, match="state bounds"):
        polish(solve(ocp, MultipleShooting(75)))
