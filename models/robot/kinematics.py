"""Where the frames of a robot are, and how they move with its joints."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.robot.description import Pose
from models.robot.motion import placed
from models.robot.tree import Tree


@dataclass(frozen=True, eq=False)
class FramePose:
    """Where a frame is in the world.

    Attributes:
        rotation: R (3, 3), its columns are the axes of the frame.
        position: p (3,) [m], its origin.
    """

    rotation: ca.SX
    position: ca.SX


def body_poses(tree: Tree, q: ca.SX) -> list[FramePose]:
    """Return where all bodies are at q (n,)."""
    poses: list[FramePose] = []
    for each in placed(tree, q):
        body = each.body
        outer = poses[body.parent] if body.parent >= 0 else world()
        x, y, z = ca.horzsplit(ca.mtimes(outer.rotation, ca.SX(body.pose.rotation)))
        s, c = each.sine, each.cosine
        poses.append(
            FramePose(
                ca.horzcat(c * x + s * y, c * y - s * x, z),
                outer.position + ca.mtimes(outer.rotation, each.shift),
            )
        )
    return poses


def world() -> FramePose:
    """Return the frame of the base."""
    return FramePose(ca.SX(np.eye(3)), ca.SX(np.zeros(3)))


def attached(poses: list[FramePose], body: int, pose: Pose) -> FramePose:
    """Return where a frame is that is fixed to a body."""
    outer = poses[body] if body >= 0 else world()
    return FramePose(
        ca.mtimes(outer.rotation, ca.SX(pose.rotation)),
        outer.position + ca.mtimes(outer.rotation, ca.SX(pose.translation)),
    )


def geometric_jacobian(tree: Tree, q: ca.SX, body: int, pose: Pose) -> ca.SX:
    r"""Return J (6, n) with :math:`(\dot p, \omega) = J \dot q` in the axes of the world."""
    poses = body_poses(tree, q)
    tip = attached(poses, body, pose).position
    columns = [ca.SX(np.zeros(6))] * tree.n
    for i in tree.inwards(body):
        moved, z = tree.bodies[i], poses[i].rotation[:, 2]
        if moved.slides:
            column = ca.vertcat(z, 0.0, 0.0, 0.0)
        else:
            column = ca.vertcat(ca.cross(z, tip - poses[i].position), z)
        columns[moved.coordinate] = columns[moved.coordinate] + moved.factor * column
    return ca.horzcat(ca.SX(6, 0), *columns)
