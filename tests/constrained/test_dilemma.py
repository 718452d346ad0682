"""Thesis 3.3: what a bounded and an unbounded cost do, and what keeps the arm clear."""

import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from models.textbook import BarrierCost, bounded_ocp, unbounded_ocp
from ocp import ProblemError, Solver, Status, evaluate, solve
from solvers import IndirectShooting, MultipleShooting, Schuetz, penalty_continuation

SCENARIO = arm_scenario("arm-001")
HARD = SCENARIO.ocp(weight=0.0, clearance=SCENARIO.radius)
# Small enough that going through the disc is cheaper than going round it.
LOW = 1e-3


def violation_of(solution) -> float:
    return evaluate(solution.with_(problem=HARD, parameters={})).violation


@pytest.mark.parametrize("solver", [Schuetz.sound(), MultipleShooting(75)], ids=["g", "d"])
def test_a_low_price_is_paid(solver: Solver) -> None:
    solution = solver.build(bounded_ocp(SCENARIO)).run(parameters={"weight": LOW})
    assert solution.status.is_success
    assert violation_of(solution) > 0.05


@pytest.mark.many
@pytest.mark.parametrize(
    "solver",
    [Schuetz(), Schuetz.sound(), IndirectShooting(steps=150), MultipleShooting(75)],
    ids=["schuetz", "schuetz-sound", "shooting", "direct"],
)
@pytest.mark.parametrize("name", ["arm-001", "arm-034"])
def test_an_unbounded_cost_breaks_with_a_clean_status(name: str, solver: Solver, capfd) -> None:
    solution = solve(unbounded_ocp(arm_scenario(name)), solver)
    assert solution.status in (Status.DIVERGED, Status.FAILED)
    for array in (solution.x, solution.u, solution.costate, solution.t):
        assert np.isfinite(array).all()
    assert capfd.readouterr() == ("", "")


def test_the_price_is_raised_until_the_path_is_clear() -> None:
    soft = bounded_ocp(SCENARIO, weight=LOW)
    solution = penalty_continuation(soft, HARD, Schuetz.sound(), parameter="weight")
    assert solution.status is Status.STATIONARY
    assert violation_of(solution) <= 1e-6
    steps = solution.history["violation"]
    assert (np.diff(steps) < 0.0).all()
    assert solution.parameters["weight"] == pytest.approx(LOW * 2.0 ** (len(steps) - 1))


def test_where_there_is_no_clear_path_no_price_is_high_enough() -> None:
    scenario = arm_scenario("arm-034")
    hard = scenario.ocp(weight=0.0, clearance=scenario.radius)
    soft, direct = bounded_ocp(scenario), MultipleShooting(40)
    solution = penalty_continuation(soft, hard, direct, parameter="weight", most=2)
    assert solution.status is Status.INFEASIBLE
    assert "clearance" in solution.message


def test_what_is_refused() -> None:
    soft = bounded_ocp(SCENARIO)
    for bad in ({"parameter": "price"}, {"factor": 1.0}, {"most": 0}):
        options = {"parameter": "weight", **bad}
        with pytest.raises(ProblemError):
            penalty_continuation(soft, HARD, Schuetz.sound(), **options)  # pyright: ignore
    with pytest.raises(ProblemError):
        BarrierCost(0.0, 0.5)


def test_a_price_that_cannot_be_raised_is_refused() -> None:
    scenario = arm_scenario("arm-001")
    soft, hard = bounded_ocp(scenario, weight=0.0), scenario.ocp(clearance=scenario.radius)
    with pytest.raises(ProblemError, match="must be positive"):
        penalty_continuation(soft, hard, MultipleShooting(20), parameter="weight")
    with pytest.raises(ProblemError, match="must be positive"):
        penalty_continuation(
            bounded_ocp(scenario), hard, MultipleShooting(20), parameter="weight", tolerance=0.0
        )
