"""A body among five obstacles: clear between the nodes, audited with coal; moving obstacles."""

# coal has no stubs, its names are made at import:
# pyright: reportAttributeAccessIssue=false

from typing import Any

import casadi as ca
import coal
import numpy as np
import pytest

from models import free_body_ocp
from models.shapes import (
    Capsule,
    ConvexHull,
    Cuboid,
    HalfSpace,
    Shape,
    Sphere,
    clearance,
    distance,
)
from ocp import OCP, Guess, Model, ProblemError, Signal, Solution, evaluate
from solvers import BetweenNodes, MultipleShooting, via_point_guesses
from tests.ocp.differences import jacobian
from tests.shapes.bodies import coal_shape
from tests.shapes.page import names_of_page
from tests.tolerances import DERIVATIVE

MARGIN, TOLERANCE = 0.05, 1e-3
TURN = np.array([[np.cos(0.5), -np.sin(0.5), 0], [np.sin(0.5), np.cos(0.5), 0], [0, 0, 1]])
FLOOR = HalfSpace([0, 0, 1])
SOLID: tuple[Shape, ...] = (
    Cuboid([0.4, 2.0, 2.0]).at([0, 0, 1], TURN),
    Sphere(0.4).at([0.9, 1.2, 1.0]),
    Capsule([0, 0, -1], [0, 0, 1], 0.2).at([-0.8, -1.3, 1.0]),
    ConvexHull(0.5 * np.vstack([np.eye(3), -np.eye(3)])).at([1.0, -0.9, 1.6]),
)
ROD = Capsule([-0.3, 0, 0], [0.3, 0, 0], 0.1)
BALLS = tuple(Sphere(0.1).at([x, 0, 0]) for x in (-0.3, -0.1, 0.1, 0.3))
SOLVER = BetweenNodes(MultipleShooting(intervals=30), tolerance=TOLERANCE)


def transfer(bodies: tuple[Shape, ...], angles: int) -> OCP:
    start, goal = [-2, 0, 1, *[0] * angles], [2, 0, 1, *[0] * angles]
    return free_body_ocp(
        bodies, (*SOLID, FLOOR), start=start, goal=goal, horizon=4.0, margin=MARGIN
    )


def goal_of(ocp: OCP) -> np.ndarray:
    return np.array([2.0, 0.0, 1.0, *[0.0] * (ocp.model.nx - 3)])


def guesses(ocp: OCP, number: int = 2) -> list[Guess]:
    moving = ("x_0", "x_1", "x_2") if ocp.model.nx > 6 else None
    return via_point_guesses(ocp, goal_of(ocp), number, seed=0, moving=moving)


def nearest_by_coal(bodies: tuple[Shape, ...], solution: Solution) -> float:
    """The least distance that coal finds along the referee's trajectory, floor included."""
    states, angles = evaluate(solution).truth.x, solution.problem.model.nx > 6
    request, found = coal.DistanceRequest(), []
    for x in states[:: max(1, len(states) // 400)]:
        yaw, pitch = (x[3], x[4]) if angles else (0.0, 0.0)
        c, s, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
        turn = np.array([[c * cp, -s, c * sp], [s * cp, c, s * sp], [-sp, 0, cp]])
        for body in bodies:
            own, y_to_x = np.array(ca.DM(ca.evalf(body.pose.p))).ravel(), np.eye(3)
            if isinstance(body, Capsule):  # coal's lie along z
                y_to_x = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
            place = coal.Transform3s(turn @ y_to_x, x[:3] + turn @ own)
            for obstacle in SOLID:
                pose = [np.array(ca.DM(ca.evalf(e))) for e in (obstacle.pose.R, obstacle.pose.p)]
                there = coal.Transform3s(pose[0], pose[1].ravel())
                shapes = coal_shape(body), coal_shape(obstacle)
                result = coal.DistanceResult()
                found.append(coal.distance(shapes[0], place, shapes[1], there, request, result))
            found.append(float(x[2]) - abs(0.3 * sp) * isinstance(body, Capsule) - 0.1)
    return min(found)


@pytest.fixture(scope="module")
def rod() -> OCP:
    return transfer((ROD,), 0)


@pytest.fixture(scope="module")
def page() -> dict[str, Any]:
    return names_of_page()


def test_a_rod_among_five_obstacles(page: dict[str, Any]) -> None:
    """The problem of the page, whose numbers hold."""
    solution = page["solution"]
    assert solution.status.is_success
    assert solution.iterations < 40
    assert page["verdict"].violation <= TOLERANCE
    assert page["verdict"].cost == pytest.approx(7.84, abs=0.01)
    assert nearest_by_coal((ROD,), solution) >= MARGIN - TOLERANCE


def test_a_lift_and_a_depth(page: dict[str, Any]) -> None:
    assert page["aside"].status.is_success
    assert evaluate(page["aside"]).violation <= 1e-6
    assert page["depth"] == pytest.approx(-0.6)


@pytest.mark.slow
def test_a_straight_line_leads_to_a_worse_way(rod: OCP) -> None:
    line = SOLVER.build(rod).run(guess=Guess(x=np.linspace(rod.start(), goal_of(rod), 31)))
    assert not line.status.is_success or evaluate(line).cost > 2.0 * 7.84


@pytest.mark.slow
def test_a_body_that_turns() -> None:
    """A rod as four balls: its distances stay smooth where it lies along a face."""
    ocp = transfer(BALLS, 2)
    solution = SOLVER.build(ocp).run(guess=guesses(ocp, 1)[0])
    assert solution.status.is_success
    assert evaluate(solution).violation <= TOLERANCE
    assert nearest_by_coal(BALLS, solution) >= MARGIN - TOLERANCE


def test_clearance_rows() -> None:
    x = ca.SX.sym("x", 3)
    one = clearance(ROD.at(x), SOLID[0], 0.1)
    assert (one.size, one.at, one.box.lower.tolist()) == (1, "path", [0.1])  # type: ignore[union-attr]
    assert one.name == "clearance of Capsule and Cuboid"
    floor = clearance(ROD.at(x), FLOOR, name="floor")
    assert (floor.name, floor.size) == ("floor", 2)  # both ends
    value = ca.Function("rows", [x], [floor.expression])([0, 0, 1.0])
    np.testing.assert_allclose(np.array(value).ravel(), [0.9, 0.9])


def test_obstacles_move_with_time_and_signals() -> None:
    """A box that a Signal shifts and time turns; the referee sees the same distance."""
    t, where, x, u = ca.SX.sym("t"), ca.SX.sym("where", 3), ca.SX.sym("x", 3), ca.SX.sym("u", 3)
    c, s, zero = ca.cos(t), ca.sin(t), ca.SX(0)
    turn = ca.vertcat(
        ca.horzcat(c, -s, zero), ca.horzcat(s, c, zero), ca.horzcat(zero, zero, ca.SX(1))
    )
    door = Cuboid([2.0, 0.1, 2.0]).at([1.0, 0, 0]).at(where, turn)
    samples = np.linspace([0, 0, 0], [0, 0, 0.5], 11)
    ocp = OCP(
        name="door",
        model=Model(name="point", x=x, u=u, f=u, t=t),
        x0=[1.0, 1.5, 0.0],
        horizon=2.0,
        running_cost=ca.sumsqr(u),
        constraints=(clearance(Sphere(0.2).at(x), door, 0.05),),
        parameters=(Signal("where", where, samples, hold="linear"),),
    )
    assert evaluate(MultipleShooting(intervals=5).build(ocp).run()).violation >= 0.0
    solution = BetweenNodes(MultipleShooting(intervals=20), tolerance=TOLERANCE).build(ocp).run()
    assert solution.status.is_success
    verdict = evaluate(solution)
    assert verdict.violation <= TOLERANCE
    assert verdict.cost > 0.05  # it had to step aside
    d = distance(Sphere(0.2).at(x), door)
    z = ca.vertcat(t, where, x)
    value = ca.Function("d", [z], [d, ca.gradient(d, z)])
    at = np.array([0.7, 0.1, -0.2, 0.3, 1.0, 1.4, 0.2])
    found = jacobian(lambda v: np.array(value(v)[0]), at)
    np.testing.assert_allclose(np.array(value(at)[1]).ravel(), found.ravel(), atol=DERIVATIVE)


def test_guesses_by_via_points(rod: OCP) -> None:
    ocp = rod
    first, second = guesses(ocp)
    assert np.abs(np.asarray(first.x) - np.asarray(second.x)).max() > 0.5
    for guess in (first, second):
        x = np.asarray(guess.x)
        np.testing.assert_allclose(x[[0, -1]], [ocp.start(), goal_of(ocp)], atol=1e-12)
    rows = ca.Function("rows", [ocp.model.x], [ca.vertcat(*[c.expression for c in ocp.at("path")])])
    assert all(float(ca.mmin(rows(x))) >= MARGIN for x in np.asarray(first.x))
    again = guesses(ocp)[0]
    np.testing.assert_array_equal(np.asarray(again.x), np.asarray(first.x))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"goal": [0.0]}, "goal has 1 entries, 6 are needed"),
        ({"goal": [np.nan] * 6}, r"goal\[0\] is nan"),
        ({"moving": ("height",)}, "there is no state 'height'"),
        ({"moving": (9,)}, "there is no state 9"),
        ({"moving": ()}, "say which states move"),
        ({"number": 0}, "number must be a whole number"),
        ({"spread": -1.0}, "spread = -1.0"),
        ({"candidates": 1, "number": 2}, "candidates must be a whole number of at least 2"),
    ],
)
def test_bad_via_points(rod: OCP, changed: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"goal": goal_of(rod), "number": 1, "seed": 0} | changed
    with pytest.raises(ProblemError, match=message):
        via_point_guesses(rod, **given)
