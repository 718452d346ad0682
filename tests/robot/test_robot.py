"""A robot's equations against each other and against differences; no other package is needed."""

import pickle
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from models.robot import Payload, Robot, panda
from models.robot.inverse_dynamics import newton_euler
from ocp import ProblemError
from tests.robot.robots import TREE, robot_of
from tests.tolerances import DERIVATIVE, ROUNDING, STEP

TIP = "thumb"


@pytest.fixture(scope="module")
def tree() -> Robot:
    return robot_of("tree")


def sample(robot: Robot, seed: int = 0) -> np.ndarray:
    """Return q, v and a (3, n)."""
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (3, robot.n))


def array(value: object) -> np.ndarray:
    found = np.array(value)
    return found.ravel() if 1 in found.shape else found


def test_what_it_consists_of(tree: Robot) -> None:
    assert tree.name == "tree"
    assert tree.joints == ("lift", "shoulder", "hip", "reach")
    assert tree.units == ("m", "rad", "rad", "m")
    assert len(tree.tree.bodies) == 6
    assert tree.limits.lower.tolist() == [-0.5, -np.inf, -1.0, 0.0]
    assert tree.limits.effort.tolist() == [300.0, 40.0, 30.0, 20.0]


def test_the_jacobian_is_the_rate_of_the_pose(tree: Robot) -> None:
    q, v, _ = sample(tree)
    ahead, behind = (tree.pose(q + side * STEP * v, TIP) for side in (1, -1))
    velocity, omega = np.split(array(tree.jacobian(q, TIP)) @ v, 2)
    moved = (array(ahead.position) - array(behind.position)) / (2 * STEP)
    np.testing.assert_allclose(velocity, moved, atol=DERIVATIVE)
    turning = array(ahead.rotation - behind.rotation) / (2 * STEP)
    cross = turning @ array(tree.pose(q, TIP).rotation).T
    np.testing.assert_allclose(omega, [cross[2, 1], cross[0, 2], cross[1, 0]], atol=DERIVATIVE)


def test_inverse_and_forward_dynamics_undo_each_other(tree: Robot) -> None:
    q, v, a = sample(tree)
    effort = array(tree.inverse_dynamics(q, v, a))
    np.testing.assert_allclose(array(tree.forward_dynamics(q, v, effort)), a, atol=ROUNDING)
    bias = array(tree.inverse_dynamics(q, v, 0 * a))
    matrix = array(tree.mass_matrix(q))
    np.testing.assert_allclose(matrix @ a + bias, effort, rtol=ROUNDING, atol=ROUNDING)
    np.testing.assert_allclose(matrix, matrix.T, atol=ROUNDING)
    assert np.linalg.eigvalsh(matrix)[0] > 0.0


def test_power_in_is_the_rate_of_energy(tree: Robot) -> None:
    r"""v' τ = d/dt (v' M v / 2) + g' v, by differences along the motion."""
    q, v, a = sample(tree)

    def energy(time: float) -> float:
        position, rate = q + time * v + time**2 / 2 * a, v + time * a
        return float(rate @ array(tree.mass_matrix(position)) @ rate / 2)

    change = (energy(STEP) - energy(-STEP)) / (2 * STEP) + array(tree.gravity_efforts(q)) @ v
    power = v @ array(tree.inverse_dynamics(q, v, a))
    assert change == pytest.approx(power, abs=DERIVATIVE * 100)  # energies of some 100 J


def test_derivatives_of_the_forward_dynamics_agree_with_differences() -> None:
    robot = Robot.from_urdf(TREE)
    q, v, a = sample(robot, 2)
    effort = array(robot.inverse_dynamics(q, v, a))
    _, *slopes = robot.forward_dynamics_derivatives(q, v, effort)
    point = np.stack([q, v, effort])
    for which, slope in enumerate(slopes):
        for i in range(robot.n):
            step = np.zeros_like(point)
            step[which, i] = STEP
            ends = [array(robot.forward_dynamics(*(point + s * step))) for s in (1, -1)]
            measured = (ends[0] - ends[1]) / (2 * STEP)
            # Accelerations are of the size 100.
            np.testing.assert_allclose(array(slope)[:, i], measured, rtol=1e-5, atol=1e-5)


def test_friction_and_armature_are_added() -> None:
    with_friction = Robot.from_urdf(TREE, tidy=0.0)
    q, v, a = sample(with_friction)
    rotors = np.array([1.0, 0.2, 0.3, 0.4])
    loaded = replace(with_friction, armature=rotors)
    bare = robot_of("tree").inverse_dynamics(q, v, a)
    extra = array(loaded.inverse_dynamics(q, v, a)) - array(bare)
    damping, coulomb = np.array([3.0, 0.5, 0.0, 0.0]), np.array([2.0, 0.3, 0.0, 0.0])
    expected = rotors * a + damping * v + coulomb * np.tanh(v / 0.01)
    np.testing.assert_allclose(extra, expected, atol=ROUNDING)
    added = array(loaded.mass_matrix(q)) - array(robot_of("tree").mass_matrix(q))
    np.testing.assert_allclose(added, np.diag(rotors), atol=ROUNDING)


def test_a_joint_that_mimics_brakes_the_one_that_it_follows() -> None:
    """Twice as fast, and with twice the lever: 1 + 2 (10 * 2 + 3)."""
    inertial = """<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
        izz="1"/></inertial>"""
    joint = (
        """<joint name="{0}" type="continuous"><parent link="a"/><child link="{1}"/>{2}</joint>"""
    )
    leads = joint.format("leads", "b", '<dynamics damping="1"/>')
    follows = '<dynamics damping="10" friction="3"/><mimic joint="leads" multiplier="2"/>'
    robot = Robot.from_urdf(
        f"""<robot name="geared"><link name="a"/><link name="b">{inertial}</link>
        <link name="c">{inertial}</link>{leads}{joint.format("follows", "c", follows)}</robot>"""
    )
    assert float(robot.inverse_dynamics([0.0], [1.0], [0.0])) == pytest.approx(47.0)


def test_regrouped_masses_move_no_torque(tree: Robot) -> None:
    q, v, a = (ca.SX(row) for row in sample(tree))
    gravity = np.asarray(tree.gravity)
    both = [
        array(ca.DM(newton_euler(tree.tree, [*map(ca.SX, inertias)], q, v, a, gravity)))
        for inertias in (tree.tree.inertias(), tree.tree.inertias(regrouped=False))
    ]
    np.testing.assert_allclose(*both, rtol=ROUNDING, atol=ROUNDING)


def test_a_payload_is_a_link_more() -> None:
    """The same mass in the description and as a payload, whose mass is known later."""
    link = """<link name="load"><inertial><origin xyz="0.01 0.02 0.1"/><mass value="3"/>
        <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.04"/></inertial></link>
        <joint name="held" type="fixed"><parent link="left tool"/><child link="load"/></joint>
        </robot>"""
    fixed = Robot.from_urdf(TREE.replace("</robot>", link))
    mass, tensor = ca.SX.sym("mass"), np.diag([0.02, 0.03, 0.04])
    robot = Robot.from_urdf(TREE).carrying(Payload("left tool", mass, (0.01, 0.02, 0.1), tensor))
    q, v, a = sample(robot)
    found = ca.Function("f", [mass], [robot.inverse_dynamics(q, v, a), robot.mass_matrix(q)])(3.0)
    expected = fixed.inverse_dynamics(q, v, a), fixed.mass_matrix(q)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(array(one), array(other), rtol=ROUNDING, atol=10 * ROUNDING)


def test_it_takes_numbers_and_expressions_of_both_kinds(tree: Robot) -> None:
    numbers = sample(tree)
    expected = array(tree.inverse_dynamics(*numbers))
    for kind in (ca.SX, ca.MX):
        symbols: Any = [kind.sym(letter, tree.n) for letter in "qva"]
        found = ca.Function("f", symbols, [tree.inverse_dynamics(*symbols)])(*numbers)
        np.testing.assert_allclose(array(found), expected, atol=ROUNDING)


def test_locked_joints_are_fixed_where_they_are_told(tree: Robot) -> None:
    held = tree.locked({"hip": 0.3, "lift": -0.2})
    assert held.joints == ("shoulder", "reach")
    q, v, a = np.array([-0.2, 0.5, 0.3, 0.1]), np.zeros(4), np.zeros(4)
    v[[1, 3]], a[[1, 3]] = (0.4, -0.6), (1.0, 2.0)
    own = [row[[1, 3]] for row in (q, v, a)]
    for frame in tree.frames:
        found, expected = held.pose(own[0], frame), tree.pose(q, frame)
        np.testing.assert_allclose(array(found.rotation), array(expected.rotation), atol=1e-12)
        np.testing.assert_allclose(array(found.position), array(expected.position), atol=1e-12)
    efforts = array(tree.inverse_dynamics(q, v, a))[[1, 3]]
    np.testing.assert_allclose(array(held.inverse_dynamics(*own)), efforts, atol=1e-11)


def test_it_can_be_copied_to_other_processes(tree: Robot) -> None:
    q, v, a = sample(tree)
    tree.inverse_dynamics(q, v, a)
    copy = pickle.loads(pickle.dumps(tree))
    np.testing.assert_array_equal(
        array(copy.inverse_dynamics(q, v, a)), array(tree.inverse_dynamics(q, v, a))
    )


def test_with_a_payload_that_is_not_known_it_can_be_copied_too(tree: Robot) -> None:
    mass = ca.SX.sym("mass")
    robot = tree.carrying(Payload("left tool", mass))
    rows = sample(tree)
    expected = ca.Function("f", [mass], [robot.inverse_dynamics(*rows)])(2.0)
    copy, symbol = pickle.loads(pickle.dumps((robot, robot.payload)))
    found = ca.Function("f", [symbol.mass], [copy.inverse_dynamics(*rows)])(2.0)
    np.testing.assert_array_equal(array(found), array(expected))


def test_right_angles_written_with_few_digits_are_tidied() -> None:
    """The hip's is 1.5707963268; what moves is below what was rounded away."""
    tidy, exact = Robot.from_urdf(TREE), robot_of("tree")
    rotation = tidy.tree.bodies[2].pose.rotation
    assert set(np.unique(rotation).tolist()) <= {-1.0, 0.0, 1.0}
    q = sample(tidy)[0]
    off = array(tidy.position(q, TIP)) - array(exact.position(q, TIP))
    assert 0.0 < np.abs(off).max() < 1e-9


# -- the Panda ----------------------------------------------------------------------


def test_the_panda_is_the_one_of_its_maker() -> None:
    """Denavit and Hartenberg's parameters, limits [Franka control interface documentation]."""
    robot = panda()
    assert robot.joints == tuple(f"panda_joint{i}" for i in range(1, 8))
    np.testing.assert_allclose(robot.limits.velocity, [2.175] * 4 + [2.61] * 3)
    np.testing.assert_allclose(robot.limits.effort, [87.0] * 4 + [12.0] * 3)
    np.testing.assert_allclose(robot.limits.lower[[3, 5]], [-3.0718, -0.0175])
    a, d = [0, 0, 0, 0.0825, -0.0825, 0, 0.088], [0.333, 0, 0.316, 0, 0.384, 0, 0]
    alpha = np.array([0, -1, 1, 1, -1, 1, 1]) * np.pi / 2
    q = np.array([0.3, -0.5, 0.2, -1.9, 0.4, 1.7, 0.6])
    pose = np.eye(4)
    for i, angle in enumerate(q):  # the modified convention [Craig]
        (sa, ca_), (s, c) = ((np.sin(x), np.cos(x)) for x in (alpha[i], angle))
        pose = pose @ np.array(
            [
                [c, -s, 0, a[i]],
                [s * ca_, c * ca_, -sa, -sa * d[i]],
                [s * sa, c * sa, ca_, ca_ * d[i]],
                [0, 0, 0, 1],
            ]
        )
    flange = pose @ [0, 0, 0.107, 1]
    np.testing.assert_allclose(array(robot.position(q, "panda_link8")), flange[:3], atol=ROUNDING)
    tcp = pose @ [0, 0, 0.107 + 0.1034, 1]
    np.testing.assert_allclose(array(robot.position(q, "panda_hand_tcp")), tcp[:3], atol=ROUNDING)


def test_the_fingers_of_the_panda_slide_as_one() -> None:
    robot = panda(fingers=True)
    assert robot.n == 8
    q = np.zeros(8)
    q[7] = 0.03
    left, right = (array(robot.position(q, f"panda_{s}finger")) for s in ("left", "right"))
    assert np.linalg.norm(left - right) == pytest.approx(0.06)


# -- what is refused ----------------------------------------------------------------


def test_a_frame_that_is_not_there_is_named() -> None:
    with pytest.raises(ProblemError, match="has no frame 'panda_tcp'; its frames are panda_link0"):
        panda().pose(np.zeros(7), "panda_tcp")
    with pytest.raises(ProblemError, match="has no frame 'cup'"):
        panda().carrying(Payload("cup", 1.0))
    names: Any = ["panda_link8"]
    with pytest.raises(ProblemError, match=r"has no frame \['panda_link8'\]; its"):
        panda().pose(np.zeros(7), names)


def test_coordinates_of_another_size_are_refused(tree: Robot) -> None:
    with pytest.raises(ProblemError, match="tree: mass matrix: coordinates has 3 entries, 4"):
        tree.mass_matrix(np.zeros(3))
    with pytest.raises(ProblemError, match=r"coordinates of shape \(3, 1\), \(4, 1\)"):
        tree.mass_matrix(ca.SX.sym("q", 3))
    with pytest.raises(ProblemError, match="finite"):
        tree.mass_matrix([0.0, np.nan, 0.0, 0.0])
    both: Any = ca.SX.sym("q", 4), ca.MX.sym("v", 4), np.zeros(4)
    with pytest.raises(ProblemError, match="tree: inverse dynamics: coordinates are SX and MX"):
        tree.inverse_dynamics(*both)
    loaded = tree.carrying(Payload("left", ca.SX.sym("mass")))
    with pytest.raises(ProblemError, match="coordinates are MX, and the payload has symbols"):
        loaded.mass_matrix(ca.MX.sym("q", 4))


def test_what_no_mass_resists_has_kinematics_only() -> None:
    text = """<robot name="thin"><link name="a"/><link name="b"/>
        <joint name="turn" type="continuous"><parent link="a"/><child link="b"/></joint></robot>"""
    robot = Robot.from_urdf(text)
    assert array(robot.position([0.3], "b")).tolist() == [0.0, 0.0, 0.0]
    with pytest.raises(ProblemError, match="joint 'turn' moves link 'b', and no inertia"):
        robot.inverse_dynamics([0.0], [0.0], [0.0])
    assert float(replace(robot, armature=2.0).mass_matrix([0.0])) == 2.0
    robot.carrying(Payload("b", 1.0, (0.0, 1.0, 0.0))).mass_matrix([0.0])


def test_a_mass_on_the_axis_resists_nothing() -> None:
    text = """<robot name="thin"><link name="a"/>
        <link name="b"><inertial><origin xyz="0.5 0 0"/><mass value="1"/>
          <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
        <joint name="turn" type="continuous"><origin rpy="0.3 0.2 0.1"/><parent link="a"/>
          <child link="b"/></joint></robot>"""
    robot = Robot.from_urdf(text)
    with pytest.raises(ProblemError, match="joint 'turn' moves link 'b', and no inertia resists"):
        robot.forward_dynamics([0.0], [0.0], [1.0])
    replace(robot, armature=0.1).forward_dynamics([0.0], [0.0], [1.0])


def test_a_heavy_follower_resists_for_the_one_that_it_follows() -> None:
    text = """<robot name="geared"><link name="a"/><link name="b"/><link name="c"><inertial>
        <mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
        </link><joint name="leads" type="continuous"><parent link="a"/><child link="b"/></joint>
        <joint name="follows" type="continuous"><parent link="a"/><child link="c"/>
          <mimic joint="leads" multiplier="2"/></joint></robot>"""
    assert float(Robot.from_urdf(text).mass_matrix([0.0])) == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"armature": -1.0}, "armature"),
        ({"armature": [1.0, 2.0]}, "armature has 2 entries, 4"),
        ({"gravity": 9.81}, "gravity has 1 entries, 3"),
        ({"friction_speed": 0.0}, "friction_speed = 0.0"),
        ({"payload": 3.0}, "payload is a float, Payload"),
        ({"description": TREE}, "description is a str"),
    ],
)
def test_wrong_numbers_are_refused(tree: Robot, change: dict, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        replace(tree, **change)


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ({"knee": 0.0}, "locked joint 'knee' is not there; joints are lift, shoulder"),
        ({"grip": 0.0}, "locked joint 'grip' is fixed already"),
        ({"close": 0.0}, "locked joint 'close' mimics 'hip': lock that one"),
        ({"hip": np.inf}, "locked joint 'hip' = inf"),
    ],
)
def test_joints_that_cannot_be_locked_are_named(tree: Robot, joints: dict, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        tree.locked(joints)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("left", -1.0), "payload at 'left': mass = -1.0"),
        (("left", 1.0, (0.0, 1.0)), "center has 2 entries"),
        (("left", 1.0, (0.0, 0.0, 0.0), np.arange(9.0).reshape(3, 3)), "tensor is not symmetric"),
        (("left", ca.SX.sym("m", 2)), "its mass has 2 entries"),
        (("left", 1.0, (0.0, 0.0, 0.0), 0.1), r"tensor has shape \(\), \(3, 3\) is needed"),
        (("left", 1.0, (0.0, 0.0, 0.0), -np.eye(3)), "principal moment of inertia is -1 kg m"),
    ],
)
def test_wrong_payloads_are_refused(arguments: tuple, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        Payload(*arguments)
