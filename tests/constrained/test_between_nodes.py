"""Path constraints between the nodes: the referee agrees, or the status says why not."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.cases import arm_scenario, required_clearance, soft_optimum
from models.textbook import discrete_double_integrator
from ocp import Box, ProblemError, Status, UnsupportedProblem, evaluate, solve
from solvers import BetweenNodes, MultipleShooting, Schuetz
from tests.constrained.test_augmented_lagrangian import ceiling_cost, under_a_ceiling
from tests.solvers.problems import point


def test_nodes_alone_are_not_enough_and_margins_are() -> None:
    name = "arm-003"
    ocp = arm_scenario(name).ocp(clearance=required_clearance(name, "beyond"))
    start = soft_optimum(name)
    plain = solve(ocp, MultipleShooting(75), guess=start)
    kept = solve(ocp, BetweenNodes(MultipleShooting(75)), guess=start)
    assert plain.status is kept.status is Status.SOLVED
    assert evaluate(plain).violation > 1e-5
    verdict = evaluate(kept)
    assert verdict.violation <= 1e-6
    assert verdict.task_drift <= 1e-6
    assert plain.cost <= verdict.cost <= plain.cost * (1 + 1e-3)
    assert kept.problem is ocp
    assert not kept.parameters


def test_ceiling_in_closed_form() -> None:
    solution = solve(under_a_ceiling(), BetweenNodes(MultipleShooting(60)))
    assert evaluate(solution).violation <= 1e-6
    assert evaluate(solution).cost == pytest.approx(ceiling_cost(), rel=2e-3)


def test_a_problem_without_constraints_is_solved_as_it_is() -> None:
    solution = solve(point(), BetweenNodes(MultipleShooting(20)))
    assert solution.status is Status.SOLVED


def test_state_bounds_get_margins_too() -> None:
    ocp = replace(under_a_ceiling(), constraints=(), state_bounds=Box(upper=0.2))
    solution = solve(ocp, BetweenNodes(MultipleShooting(60)))
    assert solution.status is Status.SOLVED
    assert evaluate(solution).violation <= 1e-6
    assert np.max(solution.x) <= 0.2 + 1e-6


@pytest.mark.slow
def test_infeasible_stays_infeasible() -> None:
    scenario = arm_scenario("arm-034")
    ocp = scenario.ocp(weight=0.0, clearance=scenario.radius)
    solution = solve(ocp, BetweenNodes(MultipleShooting(30)))
    assert solution.status is Status.INFEASIBLE
    assert "'clearance' is violated by 0.09" in solution.message


def test_what_is_refused() -> None:
    with pytest.raises(UnsupportedProblem, match="discrete"):
        BetweenNodes().build(discrete_double_integrator(steps=10, dt=0.1))
    with pytest.raises(ProblemError, match="inner"):
        BetweenNodes(Schuetz.sound())  # pyright: ignore[reportArgumentType]
    with pytest.raises(ProblemError):
        BetweenNodes(tolerance=0.0)
    with pytest.raises(ProblemError):
        BetweenNodes(max_rounds=0)
