"""What the links of a robot are in space: shapes fixed to them, from its description or as told."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.robot.description import (
    BoxShape,
    Collision,
    CylinderShape,
    Link,
    MeshShape,
    SphereShape,
)
from models.robot.description import Pose as LinkPose
from models.robot.kinematics import body_poses, world
from models.robot.robot import Robot
from models.shapes.clearance import check_shapes
from models.shapes.pose import Pose
from models.shapes.shapes import Capsule, Cuboid, HalfSpace, Shape, Sphere
from ocp import ProblemError
from ocp.internal import check_instance

# A ball is part of a capsule that it leaves by no more than this [m]: digits of the description.
_INSIDE = 1e-9


@dataclass(frozen=True, eq=False)
class LinkShape:
    """A shape that is fixed to a link.

    Args:
        link: name of the link.
        shape: in the frame of the link, with numbers for its pose.
        name: what messages call it, such as "panda_link5[1]".
    """

    link: str
    shape: Shape
    name: str


def link_shapes(
    robot: Robot, given: Mapping[str, Sequence[Shape]] | None = None
) -> tuple[LinkShape, ...]:
    """Return the shapes of all links, in the order of the description.

    Boxes and spheres are taken as they are. A cylinder becomes the capsule with the same axis,
    length and radius, whose round ends stand out. Balls that lie in a capsule of their link are
    left out.

    Args:
        robot: whose description has collision shapes.
        given: shapes in the frames of links, by the name of the link. They take the place of those
            of the description; ``()`` leaves a link out.

    Raises:
        ProblemError: naming a link that does not exist, one whose shape is a mesh, what is no
            shape; and if no link has a shape.
    """
    check_instance(robot, Robot, "link shapes: robot")
    told = {} if given is None else given
    check_instance(told, Mapping, f"{robot.name}: shapes")
    links = [link.name for link in robot.description.links]
    for link, shapes in told.items():
        _check_given(robot, link, shapes, links)
    found = [
        LinkShape(link.name, shape, f"{link.name}[{i}]")
        for link in robot.description.links
        for i, shape in enumerate(told[link.name] if link.name in told else _described(robot, link))
    ]
    if not found:
        raise ProblemError(
            f"{robot.name}: none of its links has a collision shape; give them by link, as in "
            f"shapes={{'{links[-1]}': (Capsule(start, end, radius),)}}"
        )
    return tuple(found)


def placed_shapes(robot: Robot, q: ca.SX, shapes: Sequence[LinkShape]) -> list[Shape]:
    """Return the shapes where they are at q (n,); kinematics are written once for all of them."""
    poses = body_poses(robot.tree, q)
    found: list[Shape] = []
    for each in shapes:
        body, pose = robot.tree.frames[each.link]
        outer = poses[body] if body >= 0 else world()
        found.append(_moved(each.shape, pose).placed(Pose(outer.rotation, outer.position)))
    return found


def body_of(robot: Robot, link: str) -> int:
    """Return which moving body a link is part of; -1: the base."""
    return robot.tree.frames[link][0]


def _check_given(robot: Robot, link: str, shapes: Sequence[Shape], links: list[str]) -> None:
    what = f"{robot.name}: shapes['{link}']"
    if link not in links:
        raise ProblemError(f"{what}: there is no such link; the links are {', '.join(links)}")
    check_shapes(shapes, what)
    for i, shape in enumerate(shapes):
        if isinstance(shape, HalfSpace):
            raise ProblemError(f"{what}[{i}] is a HalfSpace, which does not move")
        if ca.symvar(ca.vertcat(ca.vec(shape.pose.R), shape.pose.p)):
            raise ProblemError(
                f"{what}[{i}] has an expression for a pose; place it by numbers, in the frame of "
                "the link"
            )


def _described(robot: Robot, link: Link) -> list[Shape]:
    """Return the shapes that the description gives to a link."""
    found = [_shape(robot, link, collision) for collision in link.collisions]
    capsules = [shape for shape in found if isinstance(shape, Capsule)]
    return [
        shape
        for shape in found
        if not (isinstance(shape, Sphere) and any(_is_inside(shape, one) for one in capsules))
    ]


def _shape(robot: Robot, link: Link, collision: Collision) -> Shape:
    match collision.shape:
        case SphereShape(radius=radius):
            return Sphere(radius).at(collision.pose.translation)
        case BoxShape(size=size):
            return Cuboid(size).at(collision.pose.translation, collision.pose.rotation)
        case CylinderShape(radius=radius, length=length):
            half = np.array([0.0, 0.0, length / 2.0])
            return _moved(Capsule(-half, half, radius), collision.pose)
        case MeshShape(file=file):
            raise ProblemError(
                f"{robot.name}: link '{link.name}' has the mesh {file} for a collision shape, and "
                "distances need convex shapes of few corners: give them by link, as in "
                f"shapes={{'{link.name}': (Capsule(start, end, radius),)}}, or () to leave it out"
            )


def _moved(shape: Shape, pose: LinkPose) -> Shape:
    """Return a shape of an inner frame in the outer one; of a capsule its ends are moved.

    Numbers in its ends instead of a pose save a product of rotations where they become expressions.
    """
    whole = Pose(pose.rotation, pose.translation) @ shape.pose
    if isinstance(shape, Capsule):
        ends = whole.of(ca.SX(ca.DM(np.column_stack([shape.start, shape.end]))))
        start, end = np.array(ca.evalf(ends)).T
        return Capsule(start, end, shape.radius)
    if isinstance(shape, Sphere):
        return Sphere(shape.radius, pose=Pose(position=whole.position))
    return shape.placed(Pose(pose.rotation, pose.translation))


def _is_inside(ball: Sphere, capsule: Capsule) -> bool:
    """Return whether a ball is part of a capsule, both with numbers."""
    start, end = np.asarray(capsule.start), np.asarray(capsule.end)
    center, along = np.array(ca.evalf(ball.pose.p)).ravel(), end - start
    share = np.clip((center - start) @ along / max(along @ along, _INSIDE**2), 0.0, 1.0)
    away = float(np.linalg.norm(center - start - share * along))
    return away + ball.radius <= capsule.radius + _INSIDE
