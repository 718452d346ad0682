"""Closed loops as moving pictures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from models import PlanarArm, line, redundancy_ocp
from ocp import MPC, Box, FeedbackLaw, Plant, PlantInput, ProblemError, Rollout, closed_loop
from ocp.loop_plotting.plans import controls_ahead, sends_controls, states_ahead
from solvers import IndirectShooting, MultipleShooting
from tests.mpc.problems import cart

DT = 0.1


@pytest.fixture(scope="module")
def rollout() -> Rollout:
    mpc = MPC(ocp=cart(), solver=MultipleShooting(10), dt=DT, compiled=False)
    return mpc.run(Plant(ocp=cart(mass=1.2)), [1.0, 0.0], 0.3)


@pytest.mark.slow
def test_a_film_has_the_frames_that_were_asked_for(rollout: Rollout, tmp_path: Path) -> None:
    seen, told = [], []

    def draw(axes, x, t) -> None:
        assert not axes.lines, "the axes are empty for every frame"
        axes.plot(*x, "o")
        seen.append((t, x))

    file = rollout.animate(
        tmp_path / "new" / "film.gif", draw=draw, frames_per_second=5, speed=0.5,
        progress=lambda k, n, said="": told.append((k, n)),
    )  # fmt: skip
    with Image.open(file) as film:
        durations = [frame.info["duration"] for frame in ImageSequence.Iterator(film)]
    assert durations == [200, 200, 200, 600], "the end stays"
    assert told == [(k, 4) for k in (1, 2, 3, 4)]
    times = np.unique([t for t, _ in seen])
    np.testing.assert_allclose(times, [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(seen[-1][1], rollout.x[-1])


@pytest.mark.slow
def test_a_loaded_rollout_and_a_law_have_no_plans(rollout: Rollout, tmp_path: Path) -> None:
    loaded = Rollout.load(rollout.save(tmp_path / "loop"), rollout.plant)
    law = closed_loop(
        FeedbackLaw(law=lambda x, t: [-x[0]]), Plant(ocp=cart()), [1.0, 0.0], 2 * DT, dt=DT
    )  # fmt: skip
    for k, made in enumerate((loaded, law)):
        file = made.animate(tmp_path / f"{k}.gif", frames_per_second=1)
        assert file.read_bytes().startswith(b"GIF89a")


def test_what_is_ahead_is_the_rest_of_the_plan(rollout: Rollout) -> None:
    plan = rollout.decisions[1].plan
    assert plan is not None
    t, x = states_ahead(plan, 0.25)
    np.testing.assert_allclose(t, [0.25, *np.arange(0.3, 1.15, DT)])
    np.testing.assert_allclose(x[1:], plan.x[2:])
    np.testing.assert_allclose(x[0], (plan.x[1] + plan.x[2]) / 2.0)
    _, u = controls_ahead(plan, 0.25)
    np.testing.assert_allclose(u[:-1], plan.u[1:])
    for ahead in (states_ahead, controls_ahead):
        assert [len(part) for part in ahead(plan, 5.0)] == [0, 0]


def test_planned_inputs_are_shown_where_controls_are_sent(rollout: Rollout) -> None:
    assert sends_controls(rollout)
    free = replace(cart(), constraints=(), control_bounds=Box())
    curved = MPC(ocp=free, solver=IndirectShooting(), dt=DT, compiled=False)
    assert sends_controls(curved.run(Plant(ocp=free), [1.0, 0.0], 0.3))
    arm, start = PlanarArm((1.0, 1.0, 1.0)), np.array([2.0, -1.0, -1.0])
    path = line(np.array(arm.end_effector(start)).ravel(), (-0.5, 0.0))
    ocp, plant = (
        redundancy_ocp(arm, path, theta0=start, horizon=0.3, form=form)
        for form in ("null-space", "velocity")
    )
    mpc = MPC(
        ocp=ocp, solver=MultipleShooting(5), dt=DT, applied=PlantInput("rate"), compiled=False
    )
    assert not sends_controls(mpc.run(Plant(ocp=plant), start, 0.2))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"frames_per_second": 0}, "frames per second"),
        ({"frames_per_second": 60}, "1 to 50"),
        ({"speed": 0.0}, "speed"),
        ({"speed": np.nan}, "speed"),
        ({"speed": 1e-6}, "at most 3000"),
        ({"draw": "the cart"}, "draw is a .*, a function is needed"),
        ({"progress": 3}, "progress is an int, a function is needed"),
    ],
)
def test_what_cannot_be_filmed_is_said(rollout: Rollout, tmp_path: Path, options, said) -> None:
    with pytest.raises(ProblemError, match=said):
        rollout.animate(tmp_path / "film.gif", **options)
    with pytest.raises(ProblemError, match=r"no \.gif file"):
        rollout.animate(tmp_path / "film.mp4")
    assert not list(tmp_path.iterdir())


def test_a_loop_without_a_step_is_no_film(tmp_path: Path) -> None:
    refused = closed_loop(
        FeedbackLaw(law=lambda x, t: [np.nan]), Plant(ocp=cart()), [1.0, 0.0], DT, dt=DT
    )  # fmt: skip
    with pytest.raises(ProblemError, match="no step; it ended: t = 0 s"):
        refused.animate(tmp_path / "film.gif")
