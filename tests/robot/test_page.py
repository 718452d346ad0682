"""The page "From a URDF to a motion in ten minutes" does what it says."""

import re
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from models.robot import panda
from tests.robot.test_operations import ALL, WEIGHT, A, Q, V, operations

PAGE = Path(__file__).parents[2] / "docs" / "robots.md"


@pytest.mark.slow
def test_its_code_runs(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict = {}
    for code in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(code, "robots.md", "exec"), names)
    robot, reached = names["robot"], names["reached"]
    moved = np.array(robot.position(reached.x[-1], "panda_hand_tcp")) - np.array(
        names["pose"].position
    )
    np.testing.assert_allclose(moved.ravel(), [0.0, 0.2, 0.0], atol=1e-7)
    limit = 0.5 * robot.limits.effort + 1e-6
    assert (np.abs(names["torque"]) <= limit).all()
    followed, surprise = names["followed"], names["surprise"]
    assert followed.share.max() < 0.6  # half of it was planned
    assert np.abs(followed.error).max() < 5e-3 < np.abs(surprise.error).max()
    assert "panda_joint7" in capsys.readouterr().out


def test_its_operations_are_those_that_are_counted() -> None:
    robot = panda().without_friction()
    pose, efforts = robot.pose(Q, "panda_hand_tcp"), robot.inverse_dynamics(Q, V, A)
    accelerations = robot.forward_dynamics(Q, V, A)
    slopes = robot.forward_dynamics_derivatives(Q, V, A)
    rows = [
        f"{operations(pose.rotation, pose.position)} / "
        f"{operations(robot.jacobian(Q, 'panda_hand_tcp'))}",
        f"{operations(robot.mass_matrix(Q))} / {operations(efforts)}",
        f"{operations(accelerations)}",
        f"{operations(ca.jacobian(efforts, ALL))} / "
        f"{operations(ca.hessian(ca.dot(WEIGHT, efforts), ALL)[0])}",
        f"{operations(*slopes)} / {operations(accelerations, ca.jacobian(accelerations, ALL))}",
    ]
    text = PAGE.read_text(encoding="utf-8")
    table = text.split("| seven joints |")[1].split("\n\n")[0]
    assert re.findall(r"\| ([\d /]+) \|$", table, re.MULTILINE) == rows
