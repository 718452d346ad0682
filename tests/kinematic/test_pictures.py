"""Figures, film and tuning of the instantaneous controller."""

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import all_cases, arm_scenario
from benchmarks.figures import chosen, draw_all
from benchmarks.methods.tuned_kinematics import OFF_PATH, candidates, tuned_kinematics
from benchmarks.pictures.animation import animate
from models import Capsule, Disc, PlanarArm, Polygon
from ocp import evaluate


@pytest.mark.slow
def test_a_film_of_an_arm_among_moving_obstacles(tmp_path):
    symbol, arm = ca.SX.sym("t"), PlanarArm((1.0, 0.8))
    obstacles = (
        Disc([1.5, 1.5], 0.1).moving([0.0, -1.0], symbol),
        Capsule([0.0, 1.5], [0.5, 1.7], 0.1),
        Polygon([[1.0, -0.5], [1.4, -0.4], [1.1, 0.0]]),
    )
    t = np.linspace(0.0, 0.4, 11)
    theta = np.stack([1.0 - t, -0.5 - t], axis=1)
    file = animate(arm, t, theta, tmp_path / "new" / "film.gif", obstacles=obstacles, symbol=symbol)
    assert file.read_bytes().startswith(b"GIF89a")


def test_the_grid_is_the_same_every_time():
    grid = candidates(arm_scenario("arm-001"))
    assert grid == candidates(arm_scenario("arm-001"))
    assert len(grid) == len(set(grid)) == 80


@pytest.mark.slow
def test_tuned_controllers_follow_the_path_and_cost_more_than_the_optimum():
    reference = {c.name: c.reference.value for c in all_cases() if c.reference}
    for name, found in (("arm-002", 0.171), ("arm-003", 0.126)):
        tuned = tuned_kinematics(arm_scenario(name), "closest")
        assert tuned is not None
        verdict = evaluate(tuned.solution)
        assert verdict.task_drift <= OFF_PATH
        gap = verdict.cost / reference[f"{name}-closest"] - 1.0
        assert 0.0 < gap < found, "better than the smaller grid of an earlier search"


@pytest.mark.slow
def test_the_second_task_keeps_the_arm_clear(tmp_path):
    ((_, drawing),) = draw_all(chosen(["3.4"]), tmp_path)
    data = drawing.columns
    without, with_it = (
        data[f"distance, {name} [m]"].min() for name in ("path only", "path, then obstacle")
    )
    assert without < arm_scenario("arm-001").radius < with_it
    assert data["path error, path, then obstacle [m]"].max() < 1e-4
    assert (tmp_path / "fig-3.4.gif").stat().st_size > 10_000
