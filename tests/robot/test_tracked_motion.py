"""A robot that follows a plan: it arrives, and what it takes is what was planned."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from models.robot import Payload, tracked_motion
from ocp import ProblemError, Solution
from solvers import Collocation, MultipleShooting
from tests.robot.test_torque_ocp import EFFORT, GOAL, STRONG, arm, motion, solved


@pytest.fixture(scope="module")
def plan() -> Solution:
    """Within the limits at both ends of each step, of which it uses all."""
    return solved(motion(torque_at="ends"))


def test_it_arrives_with_the_torque_that_was_planned(plan: Solution) -> None:
    found = tracked_motion(arm(), plan)
    assert np.abs(found.error).max() < 2e-3
    np.testing.assert_allclose(found.q[-1], GOAL, atol=2e-3)
    assert found.share.max() == pytest.approx(1.0, abs=0.02)
    assert found.wanted.shape == (800, 2)


def test_its_error_is_that_of_the_sampling(plan: Solution) -> None:
    """Torques are held for a period: of first order in it, where no limit cuts them off."""
    strong = arm(effort=STRONG)
    errors = [np.abs(tracked_motion(strong, plan, period=p).error).max() for p in (2e-3, 1e-3)]
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)


def test_at_the_middle_the_ends_take_more_than_the_limits(plan: Solution) -> None:
    middle = tracked_motion(arm(), solved(motion()))
    assert middle.share.max() > 1.05 * tracked_motion(arm(), plan).share.max()


def test_a_load_that_the_controller_does_not_know_leaves_an_error(plan: Solution) -> None:
    loaded = arm(effort=STRONG).carrying(Payload("lower", 0.5, (0.5, 0.0, 0.0)))
    off = tracked_motion(arm(effort=STRONG), plan, plant=loaded)
    known = tracked_motion(loaded, plan)
    assert np.abs(off.error).max() > 10 * np.abs(known.error).max()
    assert known.wanted.max() > EFFORT


def test_what_is_beyond_the_limits_is_not_given(plan: Solution) -> None:
    """A weak robot asks for as much, is given less, and falls behind."""
    weak = arm(effort=EFFORT / 4.0)
    found = tracked_motion(weak, plan)
    assert found.share.max() > 1.0
    assert np.abs(found.error).max() > 10 * np.abs(tracked_motion(arm(), plan).error).max()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"period": 0.0}, "period = 0.0, it must be positive"),
        ({"stiffness": -1.0}, "stiffness = -1.0"),
        ({"robot": 3}, "robot is an int"),
        ({"plant": 3}, "plant is an int"),
        ({"solution": 3}, "solution is an int"),
        (
            {"plant": arm().carrying(Payload("lower", ca.SX.sym("mass")))},
            "tracked motion: plant: mass of its payload is a symbol",
        ),
        ({"robot": arm(effort=0.0)}, "effort: the limit of joint '.*' is 0"),
    ],
)
def test_wrong_input_is_named(plan: Solution, change: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"robot": arm(), "solution": plan}
    with pytest.raises(ProblemError, match=message):
        tracked_motion(**(given | change))


def test_plans_without_held_accelerations_are_named() -> None:
    options: Any = {"steps": None, "horizon": 1.0}
    strong = arm(effort=STRONG)
    by_torque = solved(motion(strong, form="torque", **options), MultipleShooting(20))
    with pytest.raises(ProblemError, match="has 4 states and 2 controls; arm needs one with 4"):
        tracked_motion(strong, by_torque)
    polynomial = solved(motion(strong, **options), Collocation(6))
    with pytest.raises(ProblemError, match=r"controls of the plan are .*, not held: take"):
        tracked_motion(strong, polynomial)
