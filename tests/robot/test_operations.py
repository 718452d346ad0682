"""What the equations of a seven-joint arm cost, in operations that no machine changes.

An operation is an instruction of a CasADi Function that computes: what reads an input, writes an
output or loads a constant is not counted.
"""

import casadi as ca
import numpy as np
import pytest

from models.robot import Robot, panda
from models.robot.inverse_dynamics import newton_euler

_MOVES = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_PARAMETER}
Q, V, A, WEIGHT = (ca.SX.sym(name, 7) for name in ("q", "v", "a", "w"))
ALL = ca.vertcat(Q, V, A)


def operations(*outputs: ca.SX) -> int:
    function = ca.Function("counted", [Q, V, A, WEIGHT], list(outputs))
    kinds = (function.instruction_id(i) for i in range(function.n_instructions()))
    return sum(kind not in _MOVES for kind in kinds)


@pytest.fixture(scope="module")
def robot() -> Robot:
    """Friction costs two operations a joint more."""
    return panda().without_friction()


def test_kinematics(robot: Robot) -> None:
    pose = robot.pose(Q, "panda_hand_tcp")
    assert operations(pose.rotation, pose.position) <= 169
    assert operations(robot.jacobian(Q, "panda_hand_tcp")) <= 200


def test_dynamics(robot: Robot) -> None:
    assert operations(robot.mass_matrix(Q)) <= 630
    assert operations(robot.inverse_dynamics(Q, V, A)) <= 876
    assert operations(robot.forward_dynamics(Q, V, A)) <= 1647


def test_derivatives_of_the_inverse_dynamics(robot: Robot) -> None:
    efforts = robot.inverse_dynamics(Q, V, A)
    assert operations(ca.jacobian(efforts, ALL)) <= 6203
    assert operations(ca.hessian(ca.dot(WEIGHT, efforts), ALL)[0]) <= 16927


def test_derivatives_of_the_forward_dynamics(robot: Robot) -> None:
    """Through the inverse dynamics they cost half of what they cost without."""
    through = operations(*robot.forward_dynamics_derivatives(Q, V, A))
    assert through <= 10859
    plain = operations(ca.jacobian(robot.forward_dynamics(Q, V, A), ALL))
    assert through < 0.6 * plain


def test_regrouping_masses_saves_operations(robot: Robot) -> None:
    costs = [
        operations(
            newton_euler(robot.tree, [*map(ca.SX, inertias)], Q, V, A, np.asarray(robot.gravity))
        )
        for inertias in (robot.tree.inertias(), robot.tree.inertias(regrouped=False))
    ]
    assert costs[0] < 0.9 * costs[1]
