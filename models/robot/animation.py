"""A motion of a robot to look at: one page that needs nothing but a browser."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from models.robot.among_obstacles import check_obstacles
from models.robot.link_shapes import link_shapes, placed_shapes
from models.robot.robot import Robot
from models.robot.tracked_motion import TrackedMotion
from models.shapes.shapes import HalfSpace, Shape
from models.shapes.surface import surface
from ocp import ProblemError, Rollout, Solution, evaluate
from ocp.internal import check_instance, check_positive, write_file

Motion: TypeAlias = Solution | Rollout | TrackedMotion

_ROBOT, _OBSTACLE, _PLANE = (0.93, 0.62, 0.23), (0.36, 0.52, 0.75), (0.82, 0.83, 0.85)
# More frames than so many are a mistake; decimals of lengths [m] and of entries of rotations.
_MOST, _DIGITS = 3000, 4


def animate_motion(
    robot: Robot,
    motion: Motion,
    path: str | Path,
    *,
    obstacles: Sequence[Shape] = (),
    frame: str | None = None,
    shapes: Mapping[str, Sequence[Shape]] | None = None,
    t: ca.SX | None = None,
    frames_per_second: float = 30.0,
) -> Path:
    """Write a motion as a page to look at in a browser; return its path.

    The page shows the shapes of the links, the obstacles, and the way of a frame. It has a button
    to play and a time line; it turns when it is dragged, the wheel brings it nearer. It is one
    file, and takes nothing from the network.

    Args:
        robot: that moves.
        motion: a ``Solution`` whose states begin with the joint coordinates, drawn as the referee
            integrates it; a ``Rollout`` of such a problem, or a ``TrackedMotion``, drawn from
            instant to instant.
        path: of the file, ``.html``.
        obstacles: ``models.shapes`` in the axes of the base; a half-space is drawn as a square.
        frame: whose way is drawn; None: the last one of the robot.
        shapes: of links, in place of those of the description; see ``link_shapes``.
        t: the symbol of time in the poses of obstacles that move.
        frames_per_second: pictures for each second of the motion.

    Raises:
        ProblemError: as ``link_shapes`` does; naming a frame that does not exist, an obstacle of
            the plane or with other symbols than t, a path that is no .html, and a motion of
            another robot or that is not finite.
        OSError: if the file cannot be written.
    """
    check_instance(robot, Robot, "animation: robot")
    what = f"{robot.name}: animation"
    check_instance(path, (str, Path), f"{what}: path")
    if Path(path).suffix != ".html":
        raise ProblemError(f"{what}: {path} is no .html file")
    check_obstacles(obstacles, f"{what}: obstacles")
    time = ca.SX.sym("t") if t is None else t
    check_instance(time, ca.SX, f"{what}: t")
    per_second = check_positive(frames_per_second, f"{what}: frames_per_second")
    frames = _frames(robot, motion, per_second, time, what)
    tip = robot.frames[-1] if frame is None else frame
    trail = frames.sampled(robot.position(frames.theta, tip), f"{what}: {tip}")
    links = placed_shapes(robot, frames.theta, link_shapes(robot, shapes))
    bodies = [_body(frames, shape, _ROBOT, what) for shape in links]
    for i, shape in enumerate(obstacles):
        colour = _PLANE if isinstance(shape, HalfSpace) else _OBSTACLE
        bodies.append(_body(frames, shape, colour, f"{what}: obstacles[{i}]"))
    scene = {
        "times": np.round(frames.times, _DIGITS).tolist(),
        "bodies": bodies,
        "trail": np.round(trail, _DIGITS).tolist(),
    }
    page = (files("models.robot") / "data" / "motion.html").read_text(encoding="utf-8")
    text = page.replace("{{title}}", escape(robot.name)).replace("{{scene}}", json.dumps(scene))
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    write_file(path, text.encode())
    return Path(path)


@dataclass(frozen=True, eq=False)
class _Frames:
    """What the pictures show: instants (K,) [s], and the joint coordinates at them (K, n)."""

    times: np.ndarray
    q: np.ndarray
    theta: ca.SX
    t: ca.SX

    def sampled(self, expression: ca.SX, what: str) -> np.ndarray:
        """Return an expression in the symbols of q and t in every frame (K, m).

        Raises:
            ProblemError: if it has another symbol, naming it and ``what``.
        """
        known = {s.element_hash() for s in ca.vertsplit(ca.vertcat(self.theta, self.t))}
        foreign = [str(s) for s in ca.symvar(expression) if s.element_hash() not in known]
        if foreign:
            raise ProblemError(
                f"{what} depends on {', '.join(foreign)}; give t=... if it is the time, and "
                "numbers for all else"
            )
        function = ca.Function("frames", [self.theta, self.t], [ca.densify(expression)])
        return np.array(function.map(len(self.times))(self.q.T, self.times[None, :])).T


def _frames(robot: Robot, motion: Motion, per_second: float, t: ca.SX, what: str) -> _Frames:
    """Return equally spaced instants, and where the joints are then."""
    check_instance(motion, (Solution, Rollout, TrackedMotion), f"{what}: motion")
    if isinstance(motion, TrackedMotion):
        known, states = motion.t, motion.q
    elif isinstance(motion, Solution):
        truth = evaluate(motion).truth
        known, states = truth.t, truth.x
    else:
        known, states = motion.t, motion.x
    if states.shape[1] < robot.n:
        raise ProblemError(
            f"{what}: the motion has {states.shape[1]} states, and {robot.name} {robot.n} joints: "
            "is it one of another robot?"
        )
    if len(known) < 2 or not np.isfinite(states).all():
        raise ProblemError(f"{what}: the motion has no finite states to draw")
    count = max(2, round(float(known[-1] - known[0]) * per_second) + 1)
    if count > _MOST:
        raise ProblemError(
            f"{what}: {count} frames, at most {_MOST}: ask for fewer frames_per_second"
        )
    times = np.linspace(known[0], known[-1], count)
    columns = [np.interp(times, known, column) for column in states[:, : robot.n].T]
    return _Frames(times, np.column_stack(columns), ca.SX.sym("q", robot.n), t)


def _body(
    frames: _Frames, shape: Shape, colour: tuple[float, float, float], what: str
) -> dict[str, Any]:
    """Return the triangles of a shape, and where it is: once, or in every frame."""
    found, pose = surface(shape), ca.vertcat(ca.vec(shape.pose.R), shape.pose.p)
    places = frames.sampled(pose, what)
    if not ca.symvar(pose):
        places = places[:1]
    return {
        "colour": colour,
        "points": np.round(found.points, _DIGITS).ravel().tolist(),
        "normals": np.round(found.normals, 2).ravel().tolist(),
        "places": np.round(places, _DIGITS).tolist(),
    }
