"""The page "From a URDF to a motion in ten minutes" does what it says."""

import re
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from models.robot import panda
from ocp import evaluate
from tests.robot.audit import clearances_by_coal
from tests.robot.test_operations import ALL, WEIGHT, A, Q, V, operations

PAGE = Path(__file__).parents[2] / "docs" / "robots.md"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What its examples, one after the other, leave behind, and what they print."""
    names: dict = {}
    folder = tmp_path_factory.mktemp("page")
    with chdir(folder), redirect_stdout(StringIO()) as printed:
        for code in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
            exec(compile(code, "robots.md", "exec"), names)
    return {**names, "printed": printed.getvalue(), "folder": folder}


@pytest.mark.slow
def test_its_code_runs(page: dict[str, Any]) -> None:
    names = page
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
    assert "panda_joint7" in names["printed"]


@pytest.mark.slow
def test_the_motion_among_obstacles_is_clear_by_coal(page: dict[str, Any]) -> None:
    """At fine instants of what the referee integrates; links are placed by their poses."""
    held, robot = page["held"], page["robot"]
    verdict = evaluate(held)
    assert verdict.violation <= 1e-3
    assert sum(c.expression.numel() for c in page["clear"].at("path")) == 105  # the page says it
    truth = verdict.truth
    instants = np.linspace(truth.t[0], truth.t[-1], 161)
    way = [np.interp(instants, truth.t, column) for column in truth.x.T]
    apart = [
        clearances_by_coal(robot, q, page["shapes"], page["obstacles"], page["pairs"])
        for q in np.column_stack(way)
    ]
    obstacles, itself = np.array(apart).T
    assert obstacles.min() >= 0.02 - 1e-3
    assert itself.min() >= -1e-3
    middle = (page["left"] + page["right"]) / 2.0
    straight, _ = clearances_by_coal(
        robot, middle, page["shapes"], page["obstacles"], page["pairs"]
    )
    assert straight < -0.02  # the straight line of the joints goes through the wall


@pytest.mark.slow
def test_the_page_that_is_drawn_is_whole(page: dict[str, Any]) -> None:
    text = (page["folder"] / "motion.html").read_text(encoding="utf-8")
    assert text.rstrip().endswith("</html>")


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
