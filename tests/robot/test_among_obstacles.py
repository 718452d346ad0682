"""Robots among obstacles: what their links are, what is kept apart, what is refused."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from models import Disc
from models.robot import (
    Robot,
    among_obstacles,
    link_shapes,
    panda,
    robot_clearances,
    self_collision_pairs,
    torque_ocp,
)
from models.robot.link_shapes import placed_shapes
from models.shapes import Capsule, Cuboid, HalfSpace, Sphere
from ocp import OCP, Model, ProblemError
from tests.robot.robots import TREE

READY = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
# Two rods in a plane, the second on the end of the first, and a third on the end of the second.
CHAIN = """<robot name="chain">
  <link name="base"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  {links}{joints}
</robot>"""
_LINK = """<link name="rod{i}"><collision><origin xyz="0.5 0 0" rpy="0 1.5707963267948966 0"/>
  <geometry><cylinder radius="0.05" length="0.8"/></geometry></collision></link>"""
_JOINT = """<joint name="joint{i}" type="revolute"><origin xyz="{x} 0 0"/>
  <parent link="{parent}"/><child link="rod{i}"/><axis xyz="0 0 1"/>
  <limit lower="-3" upper="3" velocity="1" effort="1"/></joint>"""


def chain() -> Robot:
    parents = ("base", "rod1", "rod2")
    return Robot.from_urdf(
        CHAIN.format(
            links="".join(_LINK.format(i=i) for i in (1, 2, 3)),
            joints="".join(
                _JOINT.format(i=i + 1, x=min(i, 1), parent=parent)
                for i, parent in enumerate(parents)
            ),
        )
    )


def motion(robot: Robot, start: np.ndarray) -> OCP:
    """The robot moved by its joint velocities."""
    x, u = ca.SX.sym("x", robot.n), ca.SX.sym("u", robot.n)
    model = Model(name=robot.name, x=x, u=u, f=u)
    return OCP(name="move", model=model, x0=start, horizon=1.0, running_cost=ca.sumsqr(u))


# -- shapes of links -------------------------------------------------------------------


def test_a_cylinder_is_its_enclosing_capsule_and_balls_inside_are_left_out() -> None:
    found = [each for each in link_shapes(panda()) if each.link == "panda_link1"]
    assert [each.name for each in found] == ["panda_link1[0]"]
    capsule = found[0].shape
    assert isinstance(capsule, Capsule)
    ends = np.array([capsule.start, capsule.end])
    np.testing.assert_allclose(ends, [[0, 0, -0.333], [0, 0, -0.05]], atol=1e-12)
    assert capsule.radius == 0.06


def test_shapes_are_where_their_links_are() -> None:
    robot = panda()
    theta, q = ca.SX.sym("q", robot.n), READY + 0.1
    found = link_shapes(robot)
    for each, placed in zip(found, placed_shapes(robot, theta, found), strict=True):
        points = ca.Function("points", [theta], [placed.points])(q)  # type: ignore[attr-defined]
        pose = robot.pose(q, each.link)
        own = ca.evalf(each.shape.points)  # type: ignore[attr-defined]
        expected = np.array(pose.rotation) @ np.array(own) + np.array(pose.position)
        np.testing.assert_allclose(np.array(points), expected, atol=1e-12)


def test_shapes_by_link_take_the_place_of_the_described() -> None:
    given = {"panda_hand": (Sphere(0.1),), "panda_leftfinger": ()}
    found = {each.link: each.shape for each in link_shapes(panda(), given)}
    assert found["panda_hand"] is given["panda_hand"][0]
    assert "panda_leftfinger" not in found
    assert "panda_rightfinger" in found


# -- pairs -----------------------------------------------------------------------------


def test_pairs_are_all_but_neighbours() -> None:
    assert self_collision_pairs(chain()) == (("base", "rod2"), ("base", "rod3"), ("rod1", "rod3"))


def test_pairs_that_always_touch_are_left_out() -> None:
    large = {"rod3": (Sphere(5.0),)}
    assert self_collision_pairs(chain(), shapes=large) == (("base", "rod2"),)


def test_links_that_touch_only_at_rest_are_kept() -> None:
    folded = [0.0, 2.8, 2.8]
    assert ("rod1", "rod3") in self_collision_pairs(chain(), rest=folded)


@pytest.mark.slow
def test_pairs_of_the_panda() -> None:
    pairs = self_collision_pairs(panda())
    assert ("panda_link0", "panda_hand") in pairs
    assert ("panda_link2", "panda_link3") not in pairs
    assert ("panda_link7_sc", "panda_hand") not in pairs  # they do not move against each other


# -- rows ------------------------------------------------------------------------------


def test_rows_against_a_closed_form_and_their_slopes_against_differences() -> None:
    """A ball beside the arm: its distance from the segment of a stretched chain."""
    robot, q = chain(), ca.SX.sym("q", 3)
    (c,) = robot_clearances(
        robot,
        q,
        (Sphere(0.1).at([2.5, 0.4, 0.0]),),
        0.02,
        shapes={"rod1": (), "rod2": ()},
        pairs=(),
    )
    assert c.name == "clearance of rod3[0] and obstacles[0] (Sphere)"
    assert float(np.asarray(c.lower).item()) == 0.02
    value = ca.Function("value", [q], [c.expression, ca.jacobian(c.expression, q)])
    assert float(value(np.zeros(3))[0]) == pytest.approx(0.4 - 0.1 - 0.05, abs=1e-12)
    at, h = np.array([0.1, 0.2, -0.3]), 1e-6
    slope = [float((value(at + h * e)[0] - value(at - h * e)[0]) / (2 * h)) for e in np.eye(3)]
    np.testing.assert_allclose(np.array(value(at)[1]).ravel(), slope, atol=1e-8)


def test_what_the_joints_do_not_move_has_no_row() -> None:
    names = [
        c.name
        for c in robot_clearances(panda(), ca.SX.sym("q", 7), (HalfSpace([0, 0, 1]),), pairs=())
    ]
    assert not any("link0" in name or "link1" in name for name in names)
    assert any("link3" in name for name in names)


@pytest.mark.slow
def test_a_problem_of_torques_takes_obstacles() -> None:
    robot = panda()
    goal = READY + 0.5 * np.eye(7)[0]
    plan = torque_ocp(robot, READY, goal, horizon=1.0, steps=20)
    fingers: dict = {"panda_leftfinger": (), "panda_rightfinger": ()}
    found = among_obstacles(
        plan, robot, (Sphere(0.1).at([0.0, 0.0, 1.2]),), margin=0.01, shapes=fingers, goal=goal
    )
    added = len(found.constraints) - len(plan.constraints)
    assert added == 10 + len(self_collision_pairs(robot, shapes=fingers))


# -- bad input -------------------------------------------------------------------------


def test_a_start_in_collision_names_link_and_obstacle() -> None:
    robot = chain()
    obstacles = (Sphere(0.1).at([0.0, 5.0, 0.0]), Cuboid([0.2, 0.2, 0.2]).at([2.5, 0.0, 0.0]))
    with pytest.raises(
        ProblemError,
        match=r"start: clearance of rod3\[0\] and obstacles\[1\] \(Cuboid\): .*overlap",
    ):
        among_obstacles(motion(robot, np.zeros(3)), robot, obstacles)


def test_a_start_within_the_margin_is_said() -> None:
    robot = chain()
    with pytest.raises(ProblemError, match=r"rod3\[0\] .*it is 0\.25 m, 0\.3 m are needed"):
        among_obstacles(
            motion(robot, np.zeros(3)), robot, (Sphere(0.1).at([2.5, 0.4, 0.0]),), margin=0.3
        )


def test_a_start_that_hits_itself_names_both_links() -> None:
    robot = chain()
    with pytest.raises(ProblemError, match=r"start: clearance of rod1 and rod3: .*overlap"):
        among_obstacles(motion(robot, np.array([0.0, 2.2, 2.2])), robot, ())


def test_a_goal_in_collision_is_named() -> None:
    robot = chain()
    with pytest.raises(ProblemError, match="goal: clearance of rod1 and rod3"):
        among_obstacles(motion(robot, np.zeros(3)), robot, (), goal=[0.0, 2.2, 2.2])


def test_a_free_start_is_a_guess() -> None:
    robot = chain()
    free = replace(motion(robot, np.zeros(3)), free_start=motion(robot, np.zeros(3)).model.x_names)
    found = among_obstacles(free, robot, (Sphere(0.1).at([2.5, 0.0, 0.0]),), pairs=())
    assert len(found.constraints) == 3


def test_a_goal_meets_an_obstacle_that_moves() -> None:
    """It is clear at the start, and comes to where the goal is; time is counted in steps."""
    robot, dt = chain(), 0.1
    x, u, t = ca.SX.sym("x", 3), ca.SX.sym("u", 3), ca.SX.sym("t")
    model = Model(name="chain", x=x, u=u, f=x + dt * u, dt=dt, t=t)
    steps = OCP(name="steps", model=model, x0=np.zeros(3), horizon=20, running_cost=ca.sumsqr(u))
    ball = Sphere(0.1).at(ca.vertcat(2.5, 2.0 - t, 0.0))
    among_obstacles(steps, robot, (ball,), pairs=())
    with pytest.raises(ProblemError, match=r"goal: clearance of rod3\[0\] and obstacles\[0\]"):
        among_obstacles(steps, robot, (ball,), pairs=(), goal=np.zeros(3))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"obstacles": (Disc([0.5, 0.0], 0.1),)}, r"obstacles\[0\] is a Disc of the plane"),
        ({"obstacles": Sphere(0.1)}, "put it into a tuple"),
        ({"obstacles": ("ball",)}, r"obstacles\[0\]"),
        ({"margin": -0.01}, "margin = -0.01"),
        ({"self_margin": -0.01}, "self_margin = -0.01"),
        ({"margin": np.nan}, "margin"),
        ({"q": ca.SX.sym("q", 2)}, r"q has shape \(2, 1\), \(3, 1\) is needed"),
        ({"shapes": {"elbow": ()}}, r"shapes\['elbow'\]: there is no such link.*rod3"),
        ({"shapes": {"rod1": Sphere(0.1)}}, "put it into a tuple"),
        ({"shapes": {"rod1": (HalfSpace([0, 0, 1]),)}}, "HalfSpace, which does not move"),
        ({"shapes": {"rod1": (Sphere(0.1).at(ca.SX.sym("p", 3)),)}}, "expression for a pose"),
        (
            {"shapes": {link: () for link in ("base", "rod1", "rod2", "rod3")}},
            "none of its links has a collision shape",
        ),
        ({"pairs": (("rod1", "elbow"),)}, r"pairs\[0\]: there is no link 'elbow' with a shape"),
        ({"pairs": (("rod1", "rod1"),)}, "do not move against each other"),
        ({"pairs": ("rod1",)}, "two names of links"),
    ],
)
def test_bad_input_is_named(change: dict, message: str) -> None:
    given: dict = {"q": ca.SX.sym("q", 3), "obstacles": (Sphere(0.1).at([0, 3, 0]),), **change}
    with pytest.raises(ProblemError, match=message):
        robot_clearances(chain(), **given)


def test_a_rest_pose_of_a_wrong_size() -> None:
    with pytest.raises(ProblemError, match="chain: rest has 2 entries, 3 are needed"):
        self_collision_pairs(chain(), rest=[0.0, 0.0])


def test_a_mesh_says_what_to_do() -> None:
    with pytest.raises(ProblemError, match=r"link 'column' has the mesh .*column\.stl.*shapes="):
        link_shapes(Robot.from_urdf(TREE))


def test_a_problem_with_too_few_states() -> None:
    with pytest.raises(ProblemError, match="it has 3 states, and panda 7 joints"):
        among_obstacles(motion(chain(), np.zeros(3)), panda(), ())
