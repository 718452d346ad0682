"""How far a robot is from obstacles and from itself, by coal and the poses of its links."""

from collections.abc import Mapping, Sequence
from itertools import product

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from models.robot import LinkPair, Robot, link_shapes
from models.shapes import Capsule, HalfSpace, Rounded, Shape
from tests.shapes.bodies import by_coal


def clearances_by_coal(
    robot: Robot,
    q: np.ndarray,
    shapes: Mapping[str, Sequence[Shape]],
    obstacles: Sequence[Shape],
    pairs: Sequence[LinkPair],
) -> tuple[float, float]:
    """The least distance of moving links from obstacles, and of the pairs of links [m]."""
    links: dict[str, list[tuple[Shape, np.ndarray]]] = {}
    for each in link_shapes(robot, shapes):
        pose = robot.pose(q, each.link)
        outer = np.array(pose.rotation), np.array(pose.position).ravel()
        links.setdefault(each.link, []).append((each.shape, _placed(each.shape, *outer)))
    base = {"panda_link0", "panda_link1"}  # the first turns about its own axis
    moving = [part for name, parts in links.items() if name not in base for part in parts]
    still = [(shape, _placed(shape, np.eye(3), np.zeros(3))) for shape in obstacles]
    away = min(_apart(*one, *other) for one, other in product(moving, still))
    itself = min(
        _apart(*one, *other) for a, b in pairs for one, other in product(links[a], links[b])
    )
    return away, itself


def _placed(shape: Shape, rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    """The pose (7,) of a shape as coal has it: capsules are along z, their middle at 0."""
    own, shift = np.array(ca.evalf(shape.pose.R)), np.array(ca.evalf(shape.pose.p)).ravel()
    if isinstance(shape, Capsule):
        start, end = np.asarray(shape.start), np.asarray(shape.end)
        shift = own @ (start + end) / 2.0 + shift
        along = (end - start) / np.linalg.norm(end - start)
        own = own @ Rotation.align_vectors([along], [[0.0, 0.0, 1.0]])[0].as_matrix()
    turned = Rotation.from_matrix(rotation @ own).as_quat()
    return np.concatenate([rotation @ shift + position, turned])


def _apart(shape: Shape, pose: np.ndarray, other: Shape, place: np.ndarray) -> float:
    if isinstance(other, HalfSpace):  # in closed form
        assert isinstance(shape, Rounded)
        turn = Rotation.from_quat(pose[3:])
        half = shape.core.vertices[1] - shape.core.vertices[0]
        reach = np.array([0.0, 0.0, np.linalg.norm(half) / 2.0])
        ends = pose[:3] + turn.apply([reach, -reach])
        return float((ends @ np.asarray(other.normal)).min() - other.offset - shape.radius)
    return by_coal(shape, other, np.concatenate([pose, place]))
