"""What is no shape, no pose and no clearance is refused by name."""

# Arguments of the wrong type are what this file is about:
# pyright: reportArgumentType=false

from typing import Any

import casadi as ca
import numpy as np
import pytest

from models import free_body_ocp
from models.shapes import (
    Capsule,
    ConvexHull,
    Cuboid,
    HalfSpace,
    Pose,
    Shape,
    Sphere,
    clearance,
    clearances,
    distance,
    squared_core_distance,
)
from ocp import ProblemError


class Torus(Shape):
    """A shape that is not convex."""


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
FLAT = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 0.2, 0]]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Sphere(-0.1), "Sphere: radius = -0.1, it must be 0 or more"),
        (lambda: Sphere(np.nan), "Sphere: radius = nan"),
        (lambda: Sphere("1"), "Sphere: radius = '1'"),
        (lambda: Sphere(1.0, pose=np.eye(4)), "Sphere: pose is a ndarray, Pose is needed"),
        (lambda: Capsule([0, 0], [0, 0, 1], 0.1), "Capsule: start has 2 entries"),
        (lambda: Capsule([0, 0, 0], [0, 0, np.inf], 0.1), r"Capsule: end\[2\] is inf"),
        (lambda: Capsule([0, 0, 0], [0, 0, 1], -1.0), "Capsule: radius = -1.0"),
        (lambda: Cuboid([1, 0, 1]), r"Cuboid: size\[1\] = 0.0, it must be positive"),
        (lambda: Cuboid([1, -1, 1]), r"Cuboid: size\[1\] = -1.0"),
        (lambda: Cuboid([1, 1, 1], -0.1), "Cuboid: radius = -0.1"),
        (lambda: HalfSpace([0, 0, 0]), "HalfSpace: normal has length zero"),
        (lambda: HalfSpace([0, 0, 1], np.nan), "HalfSpace: offset"),
        (lambda: ConvexHull([]), r"vertices has shape \(0,\)"),
        (lambda: ConvexHull(np.zeros((0, 3))), r"\(it is empty\)"),
        (lambda: ConvexHull(CORNERS[:3]), "are 3, at least 4 are needed"),
        (lambda: ConvexHull(FLAT), "lie in one plane"),
        (lambda: ConvexHull([[0, 0, 0]] * 5), "lie in one plane"),
        (lambda: ConvexHull(np.where(CORNERS > 0, np.nan, 0.0)), "is nan"),
        (lambda: ConvexHull("body"), r"shape \(\)"),
        (lambda: ConvexHull([[0, 0, 0], [1, 0]]), "vertices has rows of different lengths"),
        (lambda: Pose([[1, 0, 0], [0, 1]]), "rotation has rows of different lengths"),
        (lambda: ConvexHull([*CORNERS, [0.1, 0.1, 0.1]]), r"vertices\[4\] is no corner"),
        (lambda: ConvexHull(CORNERS, -0.1), "ConvexHull: radius = -0.1"),
        (lambda: Pose(1.001 * np.eye(3)), "not orthonormal: R'R differs .* by 0.002"),
        (lambda: Pose(-np.eye(3)), "a reflection"),
        (lambda: Pose(np.eye(4)), r"rotation has shape \(4, 4\)"),
        (lambda: Pose(np.full((3, 3), np.nan)), "rotation.* is nan"),
        (lambda: Pose(position=[0, 0]), "position has 2 entries"),
        (lambda: Pose(position=ca.SX.sym("p", 2)), r"position has shape \(2, 1\)"),
        (lambda: Pose(position=ca.MX.sym("p", 3)), "position is an MX"),
        (lambda: Pose(ca.MX.sym("R", 3, 3)), "rotation is an MX"),
        (lambda: distance(Sphere(1.0), [0, 0, 0]), "the second shape is a list, Shape is needed"),
        (lambda: distance(Sphere, Sphere(1.0)), r"the class Sphere.*: write Sphere\(...\)"),
        (lambda: distance(HalfSpace([0, 0, 1]), HalfSpace([0, 1, 0])), "two half-spaces"),
        (lambda: distance(Torus(), Sphere(1.0)), "Torus is none of Sphere, Capsule, Cuboid"),
        (lambda: squared_core_distance(Sphere(1.0), HalfSpace([0, 1, 0])), "a half-space has none"),
        (lambda: clearance(Sphere(1.0), Sphere(1.0)), "neither moves"),
        (lambda: clearance(Sphere(1.0), Sphere(1.0), np.nan), "clearance: margin = nan"),
        (lambda: clearances(Sphere(1.0), [Sphere(1.0)]), r"put it into a tuple: \(Sphere"),
        (lambda: clearances([1.0], [Sphere(1.0)]), r"bodies\[0\] is a float, Shape is needed"),
    ],
)
def test_shapes(make: Any, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        make()


def problem(**changed: Any) -> Any:
    given: dict[str, Any] = {
        "bodies": (Sphere(0.2),),
        "obstacles": (Cuboid([1, 1, 1]),),
        "start": [-2, 0, 0],
        "goal": [2, 0, 0],
        "horizon": 4.0,
    } | changed
    bodies, obstacles = given.pop("bodies"), given.pop("obstacles")
    return free_body_ocp(bodies, obstacles, **given)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            {"start": [-0.6, 0, 0]},
            r"free body: start: clearance of bodies\[0\] \(Sphere\) and obstacles\[0\] \(Cuboid\): "
            "they overlap by 0.1 m",
        ),
        ({"goal": [0.8, 0, 0], "margin": 0.2}, "goal: .*: it is 0.1 m, 0.2 m are needed"),
        ({"start": [1.0] * 4}, "start has 4 entries, 3 or 5"),
        ({"goal": [2, 0, 0, 0, 0]}, "goal has 5 entries, 3 are needed"),
        ({"goal": [2, 0, np.nan]}, r"goal\[2\] is nan"),
        ({"bodies": ()}, "there is no body"),
        ({"bodies": Sphere(0.2)}, "put it into a tuple"),
        ({"bodies": (HalfSpace([0, 0, 1]),)}, "a HalfSpace, which does not move"),
        ({"bodies": (Sphere(0.2).at(ca.SX.sym("x", 3)),)}, "has an expression for a pose"),
        ({"obstacles": (Sphere(0.2).at(ca.SX.sym("where", 3)),)}, "contains where_0, where_1"),
        ({"horizon": 0.0}, "horizon = 0.0"),
        ({"acceleration": -1.0}, "acceleration = -1.0"),
        ({"margin": np.inf}, "margin = inf"),
    ],
)
def test_problems(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        problem(**changed)


def test_a_long_normal_is_one() -> None:
    np.testing.assert_allclose(np.asarray(HalfSpace([0, 0, 1e200]).normal), [0, 0, 1])


def test_a_list_may_hold_symbols() -> None:
    x = ca.SX.sym("x")
    gap = ca.Function("gap", [x], [distance(Sphere(0.1).at([x, 0, 0]), Sphere(0.2))])
    np.testing.assert_allclose(float(gap(2.0)), 1.7)
