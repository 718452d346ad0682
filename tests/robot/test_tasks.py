"""Redundant robots in space: tasks and their rates, the planar arm as one case, every method."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models import ArmScenario, JointLimitCost, ManipulabilityCost, PlanarArm, line, redundancy_ocp
from models.robot import (
    OrientationTask,
    PoseTask,
    PositionTask,
    Robot,
    SpaceTask,
    panda,
    rotation_error,
)
from models.robot_path import _reach
from ocp import OCP, Box, ProblemError, evaluate, solve
from solvers import Collocation, MultipleShooting, PrioritisedKinematics, Schuetz, polish, track
from tests.tolerances import CERTIFIED, DERIVATIVE, RESIDUAL, ROUNDING, STEP

REST = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
HAND = "panda_hand_tcp"


@pytest.fixture(scope="module")
def robot() -> Robot:
    return panda()


def here(robot: Robot, q: np.ndarray, frame: str) -> tuple[np.ndarray, np.ndarray]:
    """Return position (3,) and rotation (3, 3) of a frame."""
    pose = robot.pose(q, frame)
    return np.array(pose.position).ravel(), np.array(pose.rotation)


def chain(axes: list[str], lengths: list[float]) -> Robot:
    """Return a robot of links along x, with a joint about an axis before each; its tip is last."""
    parts = ['<robot name="chain"><link name="link 0"/>']
    starts = [0.0, *lengths[:-1]]
    for i, (axis, start) in enumerate(zip(axes, starts, strict=True)):
        parts.append(
            f'<link name="link {i + 1}"/><joint name="joint {i + 1}" type="continuous">'
            f'<origin xyz="{start} 0 0"/><parent link="link {i}"/><child link="link {i + 1}"/>'
            f'<axis xyz="{axis}"/></joint>'
        )
    parts.append(
        f'<link name="tip"/><joint name="end" type="fixed"><origin xyz="{lengths[-1]} 0 0"/>'
        f'<parent link="link {len(axes)}"/><child link="tip"/></joint></robot>'
    )
    return Robot.from_urdf("".join(parts))


def error_of(task: SpaceTask, robot: Robot) -> ca.Function:
    q, t = ca.SX.sym("q", robot.n), ca.SX.sym("t")
    parts = [task.error(robot, q, t), task.jacobian(robot, q, t), task.rate(t)]
    return ca.Function("task", [q, t], parts)


def turning(t: ca.SX) -> ca.SX:
    """A frame that turns about two axes."""
    c, s, d, e = ca.cos(t), ca.sin(t), ca.cos(2 * t), ca.sin(2 * t)
    about_z = ca.vertcat(ca.horzcat(c, -s, 0), ca.horzcat(s, c, 0), ca.horzcat(0, 0, 1))
    about_x = ca.vertcat(ca.horzcat(1, 0, 0), ca.horzcat(0, d, -e), ca.horzcat(0, e, d))
    return ca.mtimes(about_z, about_x)


TASKS = [
    PositionTask(HAND, lambda t: ca.vertcat(0.3 + 0.1 * t, ca.sin(t), 0.5)),
    PositionTask(HAND, lambda t: [0.3, t, 0.5], directions=[[0.0, 1.0, 0.0], [0.6, 0.0, 0.8]]),
    OrientationTask(HAND, turning),
    PoseTask(HAND, lambda t: ca.vertcat(0.3, 0.2 * t, 0.5), turning),
]


@pytest.mark.parametrize("task", TASKS, ids=["position", "directions", "orientation", "pose"])
def test_a_velocity_as_wanted_makes_the_error_decay(task: SpaceTask, robot: Robot) -> None:
    """However large the error is: J q' = w - k e gives e' = -k e, by differences along q'."""
    function = error_of(task, robot)
    q, t, k = REST + 0.2, 0.4, 1.7
    error, jacobian, rate = (np.array(part) for part in function(q, t))
    assert np.abs(error).max() > 0.1
    velocity = (np.linalg.pinv(jacobian) @ (rate - k * error)).ravel()
    ahead, behind = (np.array(function(q + s * STEP * velocity, t + s * STEP)[0]) for s in (1, -1))
    np.testing.assert_allclose((ahead - behind) / (2 * STEP), -k * error, atol=10 * DERIVATIVE)


def test_an_error_is_what_it_says(robot: Robot) -> None:
    position, rotation = here(robot, REST, HAND)
    turn = np.array([0.2, -0.4, 0.3])
    desired = rotation @ Rotation.from_rotvec(turn).as_matrix().T
    task = PoseTask(HAND, position - np.array([0.1, 0.2, 0.3]), desired)
    error = np.array(error_of(task, robot)(REST, 0.0)[0]).ravel()
    np.testing.assert_allclose(error, [0.1, 0.2, 0.3, *turn], atol=ROUNDING)


# -- the planar arm is one case -----------------------------------------------------

SCENARIO = ArmScenario(
    name="arm-001", theta0=(1.1, -1.5, -1.6), obstacle=(1.6, 0.7), radius=0.2, influence=0.8,
    gain=100.0, velocity=(0.4, 0.0),
)  # fmt: skip


@pytest.mark.parametrize("form", ["null-space", "velocity"])
def test_a_planar_arm_as_a_robot_has_the_same_optimum(form: Any) -> None:
    arm, theta0 = SCENARIO.arm, np.array(SCENARIO.theta0)
    start = np.array(arm.end_effector(theta0)).ravel()
    posture = (JointLimitCost(3.0, -3.0, 3.0),)
    options: Any = {"theta0": theta0, "horizon": 1.0, "posture_costs": posture, "form": form}
    planar = redundancy_ocp(arm, line(start, [0.4, 0.1]), **options)
    in_space = chain(["0 0 1"] * 3, list(arm.lengths))
    path = PositionTask(
        "tip",
        lambda t: ca.vertcat(start[0] + 0.4 * t, start[1] + 0.1 * t, 0.0),
        directions=[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    )
    found = [
        solve(problem, MultipleShooting(15)).or_raise().cost
        for problem in (planar, redundancy_ocp(in_space, path, **options))
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-9)


# -- in space -----------------------------------------------------------------------

# A small one, for what goes through the minimum principle: redundancy one.
SMALL = chain(["0 0 1", "0 1 0", "0 1 0", "0 0 1"], [0.1, 0.5, 0.5, 0.3])
SMALL_REST = np.array([0.2, -0.6, 1.0, 0.5])


def small(**options: Any) -> OCP:
    start = here(SMALL, SMALL_REST, "tip")[0]
    task = PositionTask("tip", lambda t: ca.SX(start) + t * ca.DM([-0.2, 0.3, 0.1]))
    given: dict[str, Any] = {
        "theta0": SMALL_REST,
        "horizon": 1.0,
        "posture_costs": (JointLimitCost(20.0, -2.0, 2.0),),
    }
    return redundancy_ocp(SMALL, task, **(given | options))


def test_the_end_effector_moves_as_told_whatever_the_control(robot: Robot) -> None:
    position, rotation = here(robot, REST, HAND)
    task = PoseTask(HAND, lambda t: ca.SX(position) + 0.1 * t, rotation)
    ocp = redundancy_ocp(robot, task, theta0=REST, horizon=1.0)
    jacobian = np.array(robot.jacobian(REST, HAND))
    for seed in range(3):
        y = np.random.default_rng(seed).normal(size=7)
        velocity = np.array(ocp.functions.rate(REST, y, 0.0, [])).ravel()
        np.testing.assert_allclose(jacobian @ velocity, [0.1] * 3 + [0.0] * 3, atol=1e-12)


def test_methods_agree() -> None:
    """Direct in both forms, and by Schuetz' gradient."""
    costs = [
        solve(small(), MultipleShooting(40)).or_raise().cost,
        solve(small(form="velocity"), Collocation(10)).or_raise().cost,
        evaluate(solve(small(), Schuetz.sound(intervals=40))).cost,
    ]
    assert costs == pytest.approx([costs[0]] * 3, rel=1e-3)  # of second order in the interval


@pytest.mark.slow
def test_an_answer_in_space_is_polished() -> None:
    direct = solve(small(), MultipleShooting(40)).or_raise()
    exact = polish(direct)
    verdict = evaluate(exact.or_raise())
    assert verdict.cost == pytest.approx(exact.cost, rel=CERTIFIED)
    assert verdict.stationarity is not None
    assert verdict.stationarity < RESIDUAL
    assert verdict.task_drift < RESIDUAL
    assert direct.cost == pytest.approx(exact.cost, rel=1e-3)


@pytest.mark.slow
def test_a_pose_is_kept_with_all_seven_joints(robot: Robot) -> None:
    """A task of six rows and one redundancy."""
    position, rotation = here(robot, REST, HAND)
    task = PoseTask(HAND, lambda t: ca.SX(position) + t * ca.DM([0.0, 0.2, 0.1]), rotation)
    posture = (JointLimitCost(5.0, robot.limits.lower, robot.limits.upper),)
    options: Any = {"theta0": REST, "horizon": 1.5, "posture_costs": posture}
    found = solve(redundancy_ocp(robot, task, **options), MultipleShooting(20)).or_raise()
    end = here(robot, found.x[-1], HAND)
    np.testing.assert_allclose(end[0] - position, [0.0, 0.3, 0.15], atol=1e-5)  # RK4
    turned = rotation_error(rotation, ca.SX(end[1]))
    np.testing.assert_allclose(np.array(ca.DM(turned)), 0.0, atol=1e-5)


def test_an_offset_decays_where_it_is_corrected() -> None:
    start = here(SMALL, SMALL_REST, "tip")[0]
    task = PositionTask("tip", start + np.array([0.0, 0.01, 0.0]))
    ocp = redundancy_ocp(SMALL, task, theta0=SMALL_REST, horizon=1.0, correction=4.0)
    found = solve(ocp, MultipleShooting(20)).or_raise()
    left = here(SMALL, found.x[-1], "tip")[0] - start
    np.testing.assert_allclose(left, [0.0, 0.01 * (1 - np.exp(-4.0)), 0.0], atol=1e-6)


def test_instantaneous_control_takes_the_same_error() -> None:
    q, t = ca.SX.sym("q", 4), ca.SX.sym("t")
    start = here(SMALL, SMALL_REST, "tip")[0]
    target = ca.SX(start) + t * ca.DM([-0.2, 0.3, 0.1])
    hand = track("hand", q=q, t=t, value=SMALL.position(q, "tip"), desired=target, gain=10.0)
    run = PrioritisedKinematics((hand,)).build().run(SMALL_REST, duration=1.0, dt=0.01)
    reached = here(SMALL, run.q[-1], "tip")[0]
    np.testing.assert_allclose(reached - start, [-0.2, 0.3, 0.1], atol=1e-3)
    best = solve(small(), MultipleShooting(40)).or_raise()
    instantaneous = run.as_solution(small(form="velocity"))
    assert evaluate(best).cost < evaluate(instantaneous).cost


# -- what is refused ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("task", "options", "message"),
    [
        (lambda p, r: PoseTask("tip", p, r), {}, "no redundancy: the task has 6 rows, chain 4"),
        (lambda p, r: PositionTask("tip", p + 0.1), {}, "starts with an error of 0.1 .row 0."),
        (lambda p, r: PositionTask("hand", p), {}, "has no frame 'hand'"),
        (
            lambda p, r: PositionTask("tip", lambda t: ca.SX(p) + ca.vertcat(3 * t, 0, 0)),
            {},
            "leaves the workspace at t = .* s: .* m from the first joint, 'tip' comes at most 1.4",
        ),
        (
            lambda p, r: PositionTask("tip", lambda t: ca.SX(p) / t),
            {"correction": 1.0},
            "not finite at t = 0 s",
        ),
        (
            lambda p, r: PositionTask("tip", lambda t: ca.SX.sym("x", 3)),
            {"correction": 1.0},
            "contains x_0, x_1, x_2, neither t nor a parameter",
        ),
        (lambda p, r: PositionTask("tip", lambda t: t), {}, r"returns shape \(1, 1\), \(3, 1\)"),
        (lambda p, r: PositionTask("tip", [1.0, 2.0]), {}, "path has 2 entries, 3 are needed"),
        (
            lambda p, r: PositionTask("tip", p, directions=[1.0, 0.0, 0.0]),
            {},
            r"directions has shape \(3,\), \(m, 3\)",
        ),
        (
            lambda p, r: PositionTask("tip", p, directions=[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]),
            {},
            "directions depend on each other",
        ),
        (
            lambda p, r: PositionTask("tip", p, directions=np.zeros((0, 3))),
            {},
            "it is empty",
        ),
        (
            lambda p, r: PositionTask("tip", p, directions=[[1.0, 0.0], [1.0]]),
            {},
            "directions has rows of different lengths",
        ),
        (lambda p, r: OrientationTask("tip", 2 * r), {}, "rotation is not orthonormal"),
        (
            lambda p, r: PositionTask(**{"frame": 3, "path": p}),
            {},
            "position task: frame is an int",
        ),
        (lambda p, r: line([0, 0], [1, 0]), {}, "of a Robot the frame has to be named: give"),
        (
            lambda p, r: PositionTask("tip", p),
            {"theta0": np.zeros(4)},
            "starts with an error",
        ),
        (
            lambda p, r: PositionTask("tip", [1.4, 0.0, 0.0]),
            {"theta0": np.zeros(4)},
            "singular start: J.theta0. is without full rank",
        ),
        (
            lambda p, r: PositionTask("tip", p),
            {"posture_costs": (ManipulabilityCost(1.0, 1.0),)},
            "it is that of a PlanarArm, not of a Robot",
        ),
    ],
)
def test_wrong_tasks_are_named(task: Any, options: dict[str, Any], message: str) -> None:
    position, rotation = here(SMALL, SMALL_REST, "tip")
    given: dict[str, Any] = {"theta0": SMALL_REST, "horizon": 1.0}
    with pytest.raises(ProblemError, match=message):
        redundancy_ocp(SMALL, task(position, rotation), **(given | options))


def test_an_orientation_half_a_turn_away_is_named(robot: Robot) -> None:
    rotation = here(robot, REST, HAND)[1] @ np.diag([-1.0, -1.0, 1.0])
    with pytest.raises(ProblemError, match=r"less than half a turn away"):
        redundancy_ocp(robot, OrientationTask(HAND, rotation), theta0=REST, horizon=1.0)


def test_the_limits_of_a_robot_are_those_of_its_problem(robot: Robot) -> None:
    task, limits = PositionTask(HAND, here(robot, REST, HAND)[0]), robot.limits
    ocp = redundancy_ocp(robot, task, theta0=REST, horizon=1.0, form="velocity")
    assert ocp.model.x_names == robot.joints
    np.testing.assert_array_equal(np.asarray(ocp.state_bounds.lower), limits.lower)
    np.testing.assert_array_equal(np.asarray(ocp.control_bounds.upper), limits.velocity)
    (fast,) = redundancy_ocp(robot, task, theta0=REST, horizon=1.0).constraints
    np.testing.assert_array_equal(np.asarray(fast.lower), -limits.velocity)
    free: dict[str, Any] = {"joint_bounds": Box(), "velocity_bounds": Box()}
    bare = redundancy_ocp(robot, task, theta0=REST, horizon=1.0, **free)
    assert not bare.constraints
    assert not bare.state_bounds.is_active


def test_an_orientation_may_turn_by_half_a_turn_on_the_way(robot: Robot) -> None:
    rotation = here(robot, REST, HAND)[1]

    def around(t: ca.SX) -> ca.SX:
        c, s = ca.cos(np.pi * t), ca.sin(np.pi * t)
        about_z = ca.vertcat(ca.horzcat(c, -s, 0), ca.horzcat(s, c, 0), ca.horzcat(0, 0, 1))
        return ca.mtimes(ca.SX(rotation), about_z)

    ocp = redundancy_ocp(robot, OrientationTask(HAND, around), theta0=REST, horizon=2.0)
    assert ocp.model.nx == robot.n


def test_a_path_that_breaks_on_the_way_is_named(robot: Robot) -> None:
    start = ca.DM(here(robot, REST, HAND)[0])
    broken = PositionTask(HAND, lambda t: start + ca.vertcat(0, 0, 1 - ca.sqrt(1 - t)) / 100)
    with pytest.raises(ProblemError, match="the task is not finite at t = 1"):
        redundancy_ocp(robot, broken, theta0=REST, horizon=2.0)


def test_a_planar_arm_takes_no_task_in_space() -> None:
    with pytest.raises(ProblemError, match="a PositionTask is for a Robot, the arm is planar"):
        redundancy_ocp(
            PlanarArm((1.0, 1.0, 1.0)), PositionTask("tip", [1, 1, 1]), theta0=[0, 1, 1], horizon=1
        )


def test_a_joint_that_slides_reaches_as_far_as_it_may() -> None:
    """Links of 1 m and 0.5 m with a slide of at most 0.7 m between them: 2.2 m."""
    text = """<robot name="slider"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
        <link name="tip"/>
        <joint name="yaw" type="continuous"><parent link="a"/><child link="b"/>
          <axis xyz="0 0 1"/></joint>
        <joint name="out" type="prismatic"><origin xyz="1 0 0"/><parent link="b"/><child link="c"/>
          <axis xyz="1 0 0"/><limit lower="-0.2" upper="0.7" velocity="1" effort="1"/></joint>
        <joint name="turn" type="continuous"><parent link="c"/><child link="d"/>
          <axis xyz="0 0 1"/></joint>
        <joint name="end" type="fixed"><origin xyz="0.5 0 0"/><parent link="d"/>
          <child link="tip"/></joint></robot>"""
    robot = Robot.from_urdf(text)
    assert _reach(robot, "tip")[1] == pytest.approx(2.2)
