"""Motions of robots as pages: what is in them, what is refused, and what a browser shows."""

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from matplotlib.image import imread
from scipy.spatial import ConvexHull as QHull

from models import Disc
from models.robot import TrackedMotion, animate_motion, panda
from models.shapes import Capsule, ConvexHull, Cuboid, HalfSpace, Shape, Sphere
from models.shapes.surface import surface
from ocp import (
    OCP,
    FeedbackLaw,
    Model,
    Plant,
    ProblemError,
    Rollout,
    Solution,
    closed_loop,
    solve,
)
from solvers import MultipleShooting
from tests.robot.test_among_obstacles import chain

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=600,450",
    "--virtual-time-budget=2000",
]
T = ca.SX.sym("t")
OBSTACLES = (
    Cuboid([0.4, 0.1, 0.8]).at([1.5, 1.0, 0.4]),
    Sphere(0.3).at(ca.vertcat(-1.0, T, 0.5)),
    HalfSpace([0, 0, 1], -0.2),
)


def turning() -> OCP:
    """A chain of three rods that turns to a place, by its joint velocities."""
    x, u = ca.SX.sym("x", 3), ca.SX.sym("u", 3)
    return OCP(
        name="turn",
        model=Model(name="chain", x=x, u=u, f=u),
        x0=np.zeros(3),
        horizon=1.0,
        running_cost=ca.sumsqr(u),
        terminal_cost=100.0 * ca.sumsqr(x - ca.DM([1.0, 0.5, -0.5])),
    )


@pytest.fixture(scope="module")
def solution() -> Solution:
    return solve(turning(), MultipleShooting(4)).or_raise()


@pytest.fixture(scope="module")
def rollout() -> Rollout:
    law = FeedbackLaw(law=lambda x, t: np.array([1.0, 0.5, 0.0]))
    return closed_loop(law, Plant(ocp=turning()), np.zeros(3), 1.0, dt=0.25)


def scene_of(path: Path) -> dict[str, Any]:
    """What the page is given to draw."""
    found = re.search(r"const scene = (\{.*\});", path.read_text(encoding="utf-8"))
    assert found is not None
    return json.loads(found[1])


def test_the_page_shows_links_obstacles_and_the_way(solution: Solution, tmp_path: Path) -> None:
    path = animate_motion(chain(), solution, tmp_path / "m.html", obstacles=OBSTACLES, t=T)
    scene = scene_of(path)
    assert scene["times"][-1] == 1.0
    frames = len(scene["times"])
    assert frames == 31
    moves = [len(body["places"]) == frames for body in scene["bodies"]]
    assert moves == [False, True, True, True, False, True, False]  # base, rods, obstacles
    robot = chain()
    for k in (0, 17, 30):  # the controls are held and the goal is far from all bounds: a line
        q = solution.x[-1] * scene["times"][k]
        expected = np.array(robot.position(q, "rod3")).ravel()
        np.testing.assert_allclose(scene["trail"][k], expected, atol=1e-4)
    ball = np.array(scene["bodies"][5]["places"])
    np.testing.assert_allclose(ball[:, 10], scene["times"], atol=1e-4)


def test_it_takes_nothing_from_the_network(solution: Solution, tmp_path: Path) -> None:
    text = animate_motion(chain(), solution, tmp_path / "m.html").read_text(encoding="utf-8")
    assert not re.search(r"https?:|src=|import |fetch\(|<link", text)


def test_a_loop_and_a_tracked_motion_are_drawn_too(rollout: Rollout, tmp_path: Path) -> None:
    robot = chain()
    scene = scene_of(animate_motion(robot, rollout, tmp_path / "loop.html", frame="rod2"))
    end = np.array(robot.position(rollout.x[-1], "rod2")).ravel()
    np.testing.assert_allclose(scene["trail"][-1], end, atol=1e-4)
    t, zero = np.linspace(0.0, 0.5, 6), np.zeros((6, 3))
    followed = TrackedMotion(t, t[:, None] * [1.0, 0.0, 0.0], zero, zero[1:], zero, np.zeros(3))
    scene = scene_of(animate_motion(robot, followed, tmp_path / "followed.html"))
    assert scene["times"][-1] == 0.5


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(0.2),
        Capsule([0.1, 0.0, 0.0], [0.5, 0.4, 0.3], 0.1),
        Cuboid([0.2, 0.4, 0.6]),
        Cuboid([0.2, 0.4, 0.6], 0.05),
        ConvexHull(np.vstack([np.eye(3), -np.eye(3)])),
    ],
)
def test_a_surface_is_closed_and_faces_outwards(shape: Shape) -> None:
    """The volume by the divergence theorem is that of the points, and all normals point out."""
    found = surface(shape)
    a, b, c = found.points.reshape(-1, 3, 3).transpose(1, 0, 2)
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
    assert volume == pytest.approx(QHull(found.points).volume, rel=1e-9)
    across = np.cross(b - a, c - a)
    facing = np.einsum("ikj,ij->ik", found.normals.reshape(-1, 3, 3), across)
    assert (facing > -1e-12).all()
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1.0, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"path": "motion.gif"}, "no .html file"),
        ({"frame": "elbow"}, "no frame 'elbow'"),
        ({"obstacles": (Disc([0, 0], 1.0),)}, r"obstacles\[0\] is a Disc of the plane"),
        ({"obstacles": (Sphere(0.1).at(ca.vertcat(T, 0, 0)),)}, r"obstacles\[0\] depends on t"),
        ({"shapes": {"elbow": ()}}, "there is no such link"),
        ({"frames_per_second": 0.0}, "frames"),
        ({"frames_per_second": 1e5}, "100001 frames, at most 3000"),
        ({"robot": panda()}, "3 states, and panda 7 joints"),
        ({"motion": "a plan"}, "animation: motion is a str"),
        ({"motion": None}, "motion"),
        ({"t": 0.0}, "animation: t is a float"),
        ({"robot": "panda"}, "robot is a str"),
        ({"obstacles": None}, "obstacles"),
        ({"shapes": 5}, "shapes"),
    ],
)
def test_bad_input_is_named(solution: Solution, change: dict, message: str) -> None:
    given: dict = {"robot": chain(), "motion": solution, "path": "motion.html", **change}
    with pytest.raises(ProblemError, match=message):
        animate_motion(**given)


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no chromium and no google-chrome on this machine")
def test_a_browser_draws_it(solution: Solution, tmp_path: Path) -> None:
    """The picture has the colours of robot, obstacles, ground and way, and the robot moves."""
    page = animate_motion(chain(), solution, tmp_path / "m.html", obstacles=OBSTACLES, t=T)
    first, last = (picture(page, k, tmp_path) for k in (0, 30))
    hues = [[0.93, 0.62, 0.23], [0.36, 0.52, 0.75], [0.82, 0.83, 0.85], [0.75, 0.1, 0.15]]
    for image in (first, last):
        for hue in hues:
            assert share(image, hue) > 2e-4, hue
    assert np.abs(first - last).max(axis=2).mean() > 0.01


def picture(page: Path, frame: int, folder: Path) -> np.ndarray:
    """What the browser shows of a frame (height, width, 3), without the bar of the time line."""
    assert BROWSER is not None
    shot = folder / f"{frame}.png"
    subprocess.run(
        [
            BROWSER,
            *FLAGS,
            f"--user-data-dir={folder / f'profile {frame}'}",
            f"--screenshot={shot}",
            f"{page.as_uri()}#{frame}",
        ],
        check=True,
        capture_output=True,
        timeout=120,
    )
    return imread(shot)[:-45, :, :3]


def share(image: np.ndarray, colour: list[float]) -> float:
    """Which part of a picture has a colour, lit in any way."""
    length = np.linalg.norm(image, axis=2)
    cosine = image @ np.array(colour) / np.linalg.norm(colour) / np.maximum(length, 1e-9)
    return float(((cosine > 0.9995) & (length > 0.2) & (length < 1.6)).mean())
