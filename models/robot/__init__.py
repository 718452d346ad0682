"""Real robots: any tree of rigid bodies from a URDF, its kinematics, dynamics and motions."""

from models.robot.among_obstacles import among_obstacles, robot_clearances
from models.robot.animation import Motion, animate_motion
from models.robot.description import (
    BoxShape,
    Collision,
    CylinderShape,
    Description,
    Inertia,
    Joint,
    JointLimits,
    Limits,
    Link,
    MeshShape,
    Mimic,
    Pose,
    SphereShape,
)
from models.robot.files import resolve_file
from models.robot.kinematics import FramePose
from models.robot.link_shapes import LinkShape, link_shapes
from models.robot.orientation import rotation_error
from models.robot.panda import panda
from models.robot.payload import Payload
from models.robot.robot import Robot
from models.robot.self_collision import LinkPair, self_collision_pairs
from models.robot.tasks import InTime, OrientationTask, PoseTask, PositionTask, SpaceTask
from models.robot.torque_ocp import TorqueAt, TorqueForm, torque_ocp
from models.robot.tracked_motion import TrackedMotion, tracked_motion
from models.robot.urdf import read_urdf

__all__ = [
    "BoxShape",
    "Collision",
    "CylinderShape",
    "Description",
    "FramePose",
    "InTime",
    "Inertia",
    "Joint",
    "JointLimits",
    "Limits",
    "Link",
    "LinkPair",
    "LinkShape",
    "MeshShape",
    "Mimic",
    "Motion",
    "OrientationTask",
    "Payload",
    "Pose",
    "PoseTask",
    "PositionTask",
    "Robot",
    "SpaceTask",
    "SphereShape",
    "TorqueAt",
    "TorqueForm",
    "TrackedMotion",
    "among_obstacles",
    "animate_motion",
    "link_shapes",
    "panda",
    "read_urdf",
    "resolve_file",
    "robot_clearances",
    "rotation_error",
    "self_collision_pairs",
    "torque_ocp",
    "tracked_motion",
]
