"""The Panda arm of Franka Emika, whose description comes with this package."""

from importlib.resources import files

from models.robot.robot import Robot
from ocp.internal import check_flag


def panda(*, fingers: bool = False) -> Robot:
    """Return a Panda: seven revolute joints, and a hand whose fingers slide as one.

    Frames to work with: ``panda_link8`` (the flange), ``panda_hand`` and ``panda_hand_tcp``
    (between the fingertips).

    The description is ``models/robot/data/panda.urdf``, after franka_description of franka_ros
    (Apache License 2.0, see NOTICE and LICENSE there): limits of the maker; inertias identified by
    [Gaz et al. 2019], not by the maker; capsules for collision, no meshes.

    Args:
        fingers: whether they move, q then has an eighth coordinate [m]; else they stand open,
            0.04 m off the middle.
    """
    text = (files("models.robot") / "data" / "panda.urdf").read_text(encoding="utf-8")
    robot = Robot.from_urdf(text)
    is_moving = check_flag(fingers, "panda: fingers")
    return robot if is_moving else robot.locked({"panda_finger_joint1": 0.04})
