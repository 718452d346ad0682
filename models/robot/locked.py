"""Joints that are held where they are: a description with fewer of them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.robot.description import Description, Joint, Pose
from ocp import ProblemError
from ocp.internal import check_instance, check_real


def locked(description: Description, joints: Mapping[str, float]) -> Description:
    """Return a description whose named joints, and those that mimic them, are fixed.

    Args:
        description: of the robot.
        joints: by the name of each joint where it is held [rad] or [m].

    Raises:
        ProblemError: naming a joint that is not there, is fixed or mimics another one.
    """
    check_instance(joints, Mapping, f"{description.name}: locked joints (positions by name)")
    found = {joint.name: joint for joint in description.joints}
    for name, position in joints.items():
        what = f"{description.name}: locked joint '{name}'"
        check_real(position, what)
        if name not in found:
            raise ProblemError(f"{what} is not there; joints are {', '.join(found)}")
        if found[name].type == "fixed":
            raise ProblemError(f"{what} is fixed already")
        if (mimic := found[name].mimic) is not None:
            raise ProblemError(f"{what} mimics '{mimic.joint}': lock that one")
    return replace(
        description, joints=tuple(_held(joint, found, joints) for joint in description.joints)
    )


def _held(joint: Joint, found: Mapping[str, Joint], joints: Mapping[str, float]) -> Joint:
    position = _position(joint, found, joints)
    if position is None:
        return joint
    if joint.type == "prismatic":
        moved = Pose(np.eye(3), joint.axis * position)
    else:
        moved = Pose(_about(joint.axis, position), np.zeros(3))
    return replace(joint, type="fixed", origin=joint.origin @ moved, mimic=None)


def _position(
    joint: Joint, found: Mapping[str, Joint], joints: Mapping[str, float]
) -> float | None:
    """Return where a joint is held, by itself or as it mimics one; None: it moves."""
    factor, offset, seen = 1.0, 0.0, {joint.name}
    while (mimic := joint.mimic) is not None:
        factor, offset = factor * mimic.multiplier, offset + factor * mimic.offset
        if mimic.joint not in found or mimic.joint in seen:
            return None  # ``tree_of`` says what is wrong
        joint = found[mimic.joint]
        seen.add(joint.name)
    return factor * joints[joint.name] + offset if joint.name in joints else None


def _about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation (3, 3) by an angle [rad] about a unit vector."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
