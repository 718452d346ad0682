"""The sweep over all configurations: it never calls a clear motion impossible."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from benchmarks.cases import arm_scenario, required_clearance, soft_optimum
from benchmarks.questions.clear_motions import clear_motions, widest_clearance
from models import ArmScenario, link_distances, random_scenarios
from ocp import ProblemError, Status, evaluate, solve
from solvers import BetweenNodes, MultipleShooting

FEASIBLE = ("arm-003", "arm-021", "arm-035")
SQUARES = 256


def closest_along(scenario: ArmScenario, theta: np.ndarray) -> float:
    """The clearance of configurations (K, 3) [m]."""
    symbol = ca.SX.sym("theta", 3)
    distances = link_distances(scenario.arm, symbol, scenario.disc)
    closest = ca.Function("closest", [symbol], [ca.mmin(distances)])
    return float(np.array(closest.map(len(theta))(theta.T)).min())


@pytest.mark.many
@pytest.mark.parametrize("name", ["arm-001", "arm-011", "arm-022"])
def test_a_motion_that_exists_is_possible(name: str) -> None:
    scenario, truth = arm_scenario(name), evaluate(soft_optimum(name)).truth
    kept = closest_along(scenario, truth.x)
    assert not clear_motions(scenario, kept, squares=SQUARES).is_infeasible


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000), st.floats(-2.5, 2.5), st.floats(0.5, 8.0))
def test_a_random_motion_is_possible(seed: int, width: float, frequency: float) -> None:
    """The first link swings as it likes, the others follow: no sweep may exclude that."""
    (scenario,) = random_scenarios(3, 1, seed=seed)
    t = np.linspace(0.0, scenario.horizon, 4001)
    theta0 = np.array(scenario.theta0)
    first = theta0[0] + width * np.sin(frequency * t)
    p1 = np.stack([np.cos(first), np.sin(first)], axis=1)
    end = np.array(scenario.arm.end_effector(theta0)).ravel() + t[:, None] * scenario.velocity
    chord = np.linalg.norm(end - p1, axis=1)
    assume(chord.min() > 0.05 and chord.max() < 1.99)
    last = np.sign(theta0[2]) * np.arccos(chord**2 / 2.0 - 1.0)
    middle = np.arctan2(*(end - p1).T[::-1]) - last / 2.0
    theta = np.stack([first, middle - first, last], axis=1)
    assert np.allclose(scenario.arm.positions(theta)[:, -1], end)
    # Between two instants a joint moves by millimetres.
    kept = closest_along(scenario, theta) - 0.02
    sweep = clear_motions(scenario, kept, squares=SQUARES)
    assert not sweep.is_infeasible


@pytest.mark.parametrize("name", FEASIBLE)
def test_feasible_scenarios_are_not_excluded(name: str) -> None:
    sweep = clear_motions(arm_scenario(name), required_clearance(name, "beyond"), squares=SQUARES)
    assert sweep.reach == 1.0


@pytest.mark.parametrize("name", ["arm-010", "arm-018", "arm-034", "arm-039"])
def test_a_path_too_close_is_infeasible(name: str) -> None:
    scenario, asked = arm_scenario(name), required_clearance(name, "beyond")
    assert scenario.path_clearance < asked
    assert clear_motions(scenario, asked, squares=512).is_infeasible


def test_a_start_too_close_is_infeasible_at_once() -> None:
    asked = required_clearance("arm-001", "beyond")
    assert clear_motions(arm_scenario("arm-001"), asked).reach == 0.0


@pytest.mark.slow
def test_arm_036_is_infeasible_by_more_than_a_centimetre() -> None:
    """The only one whose start and path are clear enough, and no motion is."""
    scenario, asked = arm_scenario("arm-036"), required_clearance("arm-036", "beyond")
    assert scenario.path_clearance > asked
    assert clear_motions(scenario, asked).is_infeasible
    bound = widest_clearance(scenario)
    assert bound < asked - 0.01
    # What a solver keeps lies below, so the bound is not too low; and not far below.
    less = solve(scenario.ocp(clearance=0.3), BetweenNodes(MultipleShooting(75)),
                 guess=soft_optimum("arm-036"))  # fmt: skip
    assert less.status is Status.SOLVED
    assert bound >= 0.3


@pytest.mark.slow
def test_the_end_effector_bounds_what_can_be_kept() -> None:
    scenario, squares = arm_scenario("arm-034"), 512
    bound = widest_clearance(scenario, squares=squares)
    h = clear_motions(scenario, bound, squares=squares).resolution
    assert bound == pytest.approx(scenario.path_clearance, abs=h + 1e-3)


def test_bad_input() -> None:
    with pytest.raises(ProblemError, match="squares = 100"):
        clear_motions(arm_scenario("arm-001"), 0.1, squares=100)
    with pytest.raises(ProblemError, match="squares = 0"):
        clear_motions(arm_scenario("arm-001"), 0.1, squares=0)
    (four,) = random_scenarios(4, 1, seed=1)
    with pytest.raises(ProblemError, match="not three links"):
        clear_motions(four, 0.1)
