"""Descriptions that are built by hand: what is wrong is named where it is written."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from models.robot import Robot
from models.robot.description import Description, Inertia, Joint, Limits, Link, Mimic, Pose
from ocp import ProblemError

TURN = Joint("turn", "continuous", "a", "b", Pose.identity(), np.array([0.0, 0.0, 1.0]))
LINKS = (Link("a"), Link("b", Inertia(1.0, np.zeros(3), np.eye(3))))
ODD: Any = {"name": "odd", "links": LINKS, "joints": ("turn",)}


def test_lists_are_taken() -> None:
    given: Any = ([0.0, 0.0, 1.0], [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [0.0, 0.0, 0.0], [*LINKS])
    axis, rotation, translation, links = given
    joint = replace(TURN, axis=axis, origin=Pose(rotation, translation))
    robot = Robot(Description("one", links, (joint,)))
    assert float(robot.mass_matrix([0.0])) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: replace(TURN, axis=[0, 0, 2]), "joint 'turn': its axis has the length 2, 1 is"),
        (lambda: replace(TURN, axis=[0, 0, 0]), "joint 'turn': its axis has the length 0"),
        (lambda: replace(TURN, axis=[0, 1]), "joint 'turn': axis has 2 entries, 3"),
        (lambda: replace(TURN, type="spherical"), "joint 'turn': type"),
        (lambda: replace(TURN, damping=-1.0), "joint 'turn': damping = -1.0"),
        (lambda: replace(TURN, origin=np.eye(4)), "joint 'turn': origin is a ndarray, Pose"),
        (lambda: Pose(np.eye(2), np.zeros(3)), r"pose: rotation has shape \(2, 2\)"),
        (lambda: Pose(2 * np.eye(3), np.zeros(3)), "pose: rotation is not orthonormal"),
        (lambda: Inertia(-1.0, np.zeros(3), np.eye(3)), "inertia: mass = -1.0"),
        (lambda: Inertia(1.0, np.zeros(3), -np.eye(3)), "inertia: a principal moment"),
        (lambda: Limits(1.0, 0.0), "lower = 1.0 is not below upper = 0.0"),
        (lambda: Limits(velocity=-1.0), "limits: velocity = -1.0"),
        (lambda: Mimic("turn", np.nan), "mimic of 'turn': multiplier"),
        (lambda: Description("none", (), ()), "none: there are no links"),
        (lambda: Description(**ODD), "odd: an entry of joints is a str, Joint"),
    ],
)
def test_what_is_wrong_is_named(build: Callable[[], object], message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        build()
