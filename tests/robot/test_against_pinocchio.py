"""Kinematics and dynamics of ten robots against Pinocchio, to 1e-12."""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from models.robot import Robot
from tests.robot.robots import NAMES, WITHOUT_MASS, robot_of, text_of
from tests.tolerances import ROUNDING

pinocchio: Any = pytest.importorskip(
    "pinocchio", reason="pin is not installed; it is part of the extra `test`"
)
every_robot = pytest.mark.parametrize("name", NAMES)
with_masses = pytest.mark.parametrize("name", [n for n in NAMES if n not in WITHOUT_MASS])
SAMPLES = 5


@dataclass(frozen=True)
class Reference:
    """Pinocchio's model, in which joints that mimic move by themselves: v_all = leads v + ...

    What a leader feels of those that follow it is their effort times the multiplier.
    """

    model: Any
    leads: np.ndarray
    offset: np.ndarray

    @classmethod
    def of(cls, robot: Robot, text: str) -> "Reference":
        model = pinocchio.buildModelFromXML(text)
        leads, offset = np.zeros((model.nv, robot.n)), np.zeros(model.nv)
        for body in robot.tree.bodies:
            i = model.joints[model.getJointId(body.joint)].idx_v
            leads[i, body.coordinate], offset[i] = body.factor, body.offset
        return cls(model, leads, offset)

    def positions(self, q: np.ndarray) -> np.ndarray:
        """Continuous joints have a cosine and a sine there."""
        found, each = pinocchio.neutral(self.model), self.leads @ q + self.offset
        for joint in list(self.model.joints)[1:]:
            angle, i = each[joint.idx_v], joint.idx_q
            found[i : i + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        return found

    def efforts(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        data = self.model.createData()
        moved = self.leads @ v, self.leads @ a
        return self.leads.T @ pinocchio.rnea(self.model, data, self.positions(q), *moved)

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        upper = np.triu(pinocchio.crba(self.model, self.model.createData(), self.positions(q)))
        return self.leads.T @ (upper + np.triu(upper, 1).T) @ self.leads


@cache
def reference_of(name: str) -> Reference:
    return Reference.of(robot_of(name), text_of(name))


def samples(robot: Robot) -> np.ndarray:
    """Return positions, rates and accelerations (SAMPLES, 3, n)."""
    return np.random.default_rng(7).uniform(-1.5, 1.5, (SAMPLES, 3, robot.n))


def assert_same(found: Any, expected: np.ndarray) -> None:
    found = np.array(found).reshape(expected.shape)
    np.testing.assert_allclose(
        found, expected, rtol=0.0, atol=ROUNDING * max(1.0, abs(expected).max())
    )


@every_robot
def test_poses_and_jacobians_of_all_frames(name: str) -> None:
    robot, reference = robot_of(name), reference_of(name)
    model, data = reference.model, reference.model.createData()
    for q, _, _ in samples(robot):
        pinocchio.computeJointJacobians(model, data, reference.positions(q))
        pinocchio.updateFramePlacements(model, data)
        for frame in robot.frames:
            i = model.getFrameId(frame)
            pose = robot.pose(q, frame)
            assert_same(pose.position, data.oMf[i].translation)
            assert_same(pose.rotation, data.oMf[i].rotation)
            aligned = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
            jacobian = pinocchio.getFrameJacobian(model, data, i, aligned)
            assert_same(robot.jacobian(q, frame), jacobian @ reference.leads)


@with_masses
def test_inverse_dynamics_and_mass_matrix(name: str) -> None:
    robot, reference = robot_of(name), reference_of(name)
    for q, v, a in samples(robot):
        assert_same(robot.inverse_dynamics(q, v, a), reference.efforts(q, v, a))
        assert_same(robot.gravity_efforts(q), reference.efforts(q, 0 * v, 0 * a))
        assert_same(robot.mass_matrix(q), reference.mass_matrix(q))


@with_masses
def test_forward_dynamics_and_its_derivatives(name: str) -> None:
    robot, reference = robot_of(name), reference_of(name)
    for q, v, a in samples(robot):
        effort = reference.efforts(q, v, a)
        assert_same(robot.forward_dynamics(q, v, effort), a)
        found, by_q, by_v, by_effort = robot.forward_dynamics_derivatives(q, v, effort)
        assert_same(found, a)
        assert_same(by_effort, np.linalg.inv(reference.mass_matrix(q)))
        if reference.model.nv == robot.n:  # Pinocchio has none where joints mimic
            data = reference.model.createData()
            expected = pinocchio.computeABADerivatives(
                reference.model, data, reference.positions(q), v, effort
            )
            order = np.argmax(reference.leads, axis=1)
            assert_same(np.array(by_q)[np.ix_(order, order)], expected[0])
            assert_same(np.array(by_v)[np.ix_(order, order)], expected[1])


def test_the_armature_is_that_of_pinocchio() -> None:
    robot, reference = robot_of("ur5e"), reference_of("ur5e")
    rotors = np.linspace(0.1, 0.6, 6)
    model = reference.model.copy()
    model.armature[:] = rotors
    q, v, a = samples(robot)[0]
    heavier = replace(robot, armature=rotors)
    assert_same(
        heavier.inverse_dynamics(q, v, a),
        Reference.efforts(replace(reference, model=model), q, v, a),
    )
    assert_same(heavier.mass_matrix(q), Reference.mass_matrix(replace(reference, model=model), q))


def test_the_tidied_panda_differs_by_rounding_only() -> None:
    """Its description has all digits of right angles, so that no angle is moved."""
    tidy, reference = Robot.from_urdf(text_of("panda")), reference_of("panda")
    for q, v, a in samples(tidy):
        assert_same(tidy.without_friction().inverse_dynamics(q, v, a), reference.efforts(q, v, a))
