"""Path constraints between the nodes: the referee agrees, or the status says why not."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import arm_scenario, required_clearance, soft_optimum
from models.textbook import discrete_double_integrator
from ocp import (
    OCP,
    RK4,
    Box,
    Constraint,
    Model,
    ProblemError,
    Status,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import BetweenNodes, MultipleShooting, Schuetz
from tests.constrained.test_augmented_lagrangian import ceiling_cost, under_a_ceiling
from tests.solvers.problems import point


@pytest.mark.slow
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


def swing_up() -> OCP:
    """A pendulum to its upper rest in 3 s, at a speed that is limited."""
    angle, rate, torque = (ca.SX.sym(name) for name in ("angle", "rate", "torque"))
    x = ca.vertcat(angle, rate)
    f = ca.vertcat(rate, -9.81 * ca.sin(angle) + torque)
    top = [np.pi, 0.0]
    return OCP(
        name="swing-up",
        model=Model(name="pendulum", x=x, u=torque, f=f),
        x0=[0.0, 0.0],
        horizon=3.0,
        running_cost=torque**2,
        constraints=(
            Constraint("end", x, top, top, at="terminal"),
            Constraint("speed", rate, -6.0, 6.0),
        ),
    )


def test_an_end_that_drifts_by_the_integrator_is_inaccurate() -> None:
    coarse = solve(swing_up(), BetweenNodes(MultipleShooting(10)))
    assert coarse.status is Status.INACCURATE
    assert "the integrator is too coarse on 40 intervals" in coarse.message
    assert evaluate(coarse).violation > 1e-4


def test_the_intervals_are_halved_before_it_gives_up() -> None:
    ocp = swing_up()
    solution = solve(ocp, BetweenNodes(MultipleShooting(40, RK4(4)), tolerance=1e-5))
    assert solution.status is Status.SOLVED
    coarser = solve(ocp, BetweenNodes(MultipleShooting(30), tolerance=1e-4))
    assert coarser.status is Status.SOLVED
    assert len(coarser.t) > 31
    assert evaluate(coarser).violation <= 1e-4


def test_what_is_refused() -> None:
    with pytest.raises(UnsupportedProblem, match="discrete"):
        BetweenNodes().build(discrete_double_integrator(steps=10, dt=0.1))
    with pytest.raises(ProblemError, match="inner"):
        BetweenNodes(Schuetz.sound())  # pyright: ignore[reportArgumentType]
    with pytest.raises(ProblemError):
        BetweenNodes(tolerance=0.0)
    with pytest.raises(ProblemError):
        BetweenNodes(max_rounds=0)
