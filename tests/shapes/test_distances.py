"""Distances in space: against coal and closed forms, their derivatives against differences."""

import casadi as ca
import numpy as np
import pytest

from models.shapes import (
    Capsule,
    ConvexHull,
    Cuboid,
    HalfSpace,
    Shape,
    Sphere,
    distance,
    squared_core_distance,
)
from models.shapes.cuboids import segment_to_box
from models.shapes.segments import point_to_segment, segment_to_segment
from tests.ocp.differences import jacobian
from tests.shapes.bodies import PAIRS, SHAPES, by_coal, derivatives, numeric, poses
from tests.tolerances import DERIVATIVE

pairs = pytest.mark.parametrize(("first", "second"), PAIRS)
AXIS = np.array([0.0, 0.0, 1.0])


@pairs
def test_against_coal(first: str, second: str) -> None:
    """Apart, touching and overlapping: the depth of coal is the same least shift."""
    rng = np.random.default_rng(1)
    given = np.vstack([poses(rng, 20), poses(rng, 10, 0.2)])
    values = np.array(derivatives(first, second).map(len(given))(given.T)[0]).ravel()
    expected = [by_coal(SHAPES[first], SHAPES[second], pose) for pose in given]
    apart = np.array(expected) > 0.0
    np.testing.assert_allclose(values[apart], np.array(expected)[apart], atol=1e-9)
    # Depths are found by another algorithm, with a tolerance of its own; points have none.
    np.testing.assert_allclose(values[~apart], np.array(expected)[~apart], atol=1e-7)


@pairs
def test_derivatives_against_differences(first: str, second: str) -> None:
    function, h = derivatives(first, second), 1e-6
    given = np.vstack([poses(np.random.default_rng(2), 2), poses(np.random.default_rng(3), 1, 0.2)])
    for z in given:
        _, gradient, hessian = (np.array(value) for value in function(z))
        found = jacobian(lambda v: np.array(function(v)[0]).ravel(), z, h)
        np.testing.assert_allclose(gradient.ravel(), found.ravel(), atol=DERIVATIVE)
        bends = jacobian(lambda v: np.array(function(v)[1]).ravel(), z, h)
        np.testing.assert_allclose(hessian, bends, atol=1e-6 * (1.0 + np.abs(hessian).max()))


# Along axes, on corners, faces, edges, one in the other, and turned by a quarter.
SPECIAL = [
    np.hstack([place, turn, np.zeros(3), [0.0, 0.0, 0.0, 1.0]])
    for place in ([0, 0, 0], [0.3, 0.4, 0.5], [0.3, 0, 0], [0, 0, 0.9], [0, 0.8, 1.0], [2, 0, 0])
    for turn in ([0.0, 0.0, 0.0, 1.0], [0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)], [1.0, 0.0, 0.0, 0.0])
]


@pairs
def test_all_derivatives_are_finite_everywhere(first: str, second: str) -> None:
    for z in SPECIAL:
        for value in derivatives(first, second)(z):
            assert np.isfinite(np.array(value)).all()


@pairs
def test_special_poses_against_coal(first: str, second: str) -> None:
    """Parallel faces and edges, corners on faces: nearest points are not unique there."""
    for z in SPECIAL:
        expected = by_coal(SHAPES[first], SHAPES[second], z)
        if expected > 1e-6:  # at contact and below coal's own errors show
            assert float(derivatives(first, second)(z)[0]) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-17, 1e-12, 1e-8, 1e-6, 1e-3, 1.0])
@pytest.mark.parametrize("shift", [0.0, 0.3, 1.5])
def test_nearly_parallel_capsules(angle: float, shift: float) -> None:
    """Rods that cross, or whose ends are nearest, 0.5 m above each other."""
    one = Capsule([-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], 0.1)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    other = Capsule([-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], 0.05).at([shift, 0.0, 0.5], turn)
    grid = np.linspace(-0.5, 0.5, 401)
    # Brute force along one, the exact distance of a point from the other.
    points = np.outer(grid, [c, s, 0.0]) + np.array([shift, 0.0, 0.5])
    brute = np.hypot(
        np.linalg.norm(points[:, 1:], axis=1), np.maximum(0.0, points[:, 0] - 0.5)
    ).min()
    assert numeric(one, other) == pytest.approx(brute - 0.15, abs=1e-5)
    assert numeric(one, other) <= brute - 0.15 + 1e-12
    if shift == 0.0:
        assert numeric(one, other) == pytest.approx(0.35, abs=1e-12)


def test_what_has_no_size_is_a_point() -> None:
    """Capsules without length, balls without radius, in all kinds of pairs."""
    ball = Sphere(0.2).at([1.0, 2.0, 2.0])
    assert numeric(Sphere(0.0), ball) == pytest.approx(2.8, abs=1e-15)
    same = Capsule([1.0, 2.0, 2.0], [1.0, 2.0, 2.0], 0.2)
    for other in [*SHAPES.values(), HalfSpace(AXIS)]:
        there = other.at([0.1, -0.4, -2.0])
        assert numeric(same, there) == pytest.approx(numeric(ball, there), abs=1e-14)
    assert numeric(same, same) == pytest.approx(-0.4, abs=1e-9)


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        (Sphere(0.5), Sphere(0.5).at([1.0, 0.0, 0.0]), 0.0),  # touching
        (Cuboid([1, 1, 1]), Cuboid([1, 1, 1]).at([1.0, 0.0, 0.0]), 0.0),  # face on face
        (Cuboid([1, 1, 1]), Cuboid([1, 1, 1]).at([1.0, 1.0, 1.0]), 0.0),  # corner on corner
        (Cuboid([1, 1, 1]), Cuboid([1, 1, 1]), -1.0),  # one in the other
        (Cuboid([1, 1, 1]), Sphere(0.1), -0.6),  # the centre of a ball in that of a box
        (Cuboid([2, 2, 4]), Capsule([-9, 0, 0], [9, 0, 0], 0.1), -1.1),  # through and through
        (Cuboid([2, 2, 2]), Sphere(0.0).at([2.0, 2.0, 2.0]), np.sqrt(3.0)),
        (HalfSpace(AXIS, 1.0), Cuboid([1, 1, 1]).at([0, 0, 3.0]), 1.5),
        (HalfSpace([0, 0, 5.0], 1.0), Sphere(0.5).at([7.0, 0, 0.0]), -1.5),
    ],
)
def test_known_distances(a: Shape, b: Shape, expected: float) -> None:
    assert numeric(a, b) == pytest.approx(expected, abs=2e-10)
    assert numeric(b, a) == pytest.approx(expected, abs=2e-10)


def test_at_contact_with_a_face_the_gradient_points_away() -> None:
    x = ca.SX.sym("x", 3)
    for body in (Sphere(0.1), Capsule([0, 0, 0], [0.2, 0.1, 0.3], 0.0), Cuboid([0.2, 0.2, 0.2])):
        d = distance(body.at(x), Cuboid([1, 1, 1]))
        gradient = ca.Function("g", [x], [ca.gradient(d, x)])
        low = {Sphere: 0.1, Capsule: 0.0, Cuboid: 0.1}[type(body)]
        for away in (-1e-3, -1e-9, 0.0, 1e-9, 1e-3):
            g = np.array(gradient([0.03, 0.02, 0.5 + low + away])).ravel()
            np.testing.assert_allclose(g, AXIS, atol=1e-6)


def test_squares_are_those_of_the_cores() -> None:
    rng = np.random.default_rng(4)
    for first, second in PAIRS:
        a, b = SHAPES[first], SHAPES[second]
        p = rng.normal(size=3) * 3.0
        square = float(ca.evalf(squared_core_distance(a, b.at(p))))
        radii = sum(shape.radius for shape in (a, b))  # type: ignore[attr-defined] all are rounded
        assert numeric(a, b.at(p)) == pytest.approx(np.sqrt(square) - radii, abs=1e-9)


def test_operations() -> None:
    """Of value, gradient and Hessian (its upper half), with everything that is called."""
    x, y, z = ca.SX.sym("x", 9), ca.SX.sym("y", 12), ca.SX.sym("z", 6)
    half = ca.DM([0.3, 0.4, 0.5])
    point = point_to_segment(x[:3], x[3:6], x[6:]).squared
    segments = segment_to_segment(ca.reshape(y[:6], 3, 2), ca.reshape(y[6:], 3, 2)).squared
    box = segment_to_box(z[:3], z[3:], half, signed=False).squared
    for expression, symbols, most in (
        (point, x, (35, 78, 501)),
        (segments, y, (78, 217, 2189)),  # two decide which end of nearly parallel ones is near
        (box, z, (510, 1246, 6807)),
    ):
        hessian, gradient = ca.hessian(expression, symbols)
        for each, limit in zip((expression, gradient, ca.triu(hessian)), most, strict=True):
            function = ca.Function("counted", [symbols], [each], {"cse": True})
            assert _operations(function) <= limit


def _operations(function: ca.Function) -> int:
    """Count what is neither input, output nor number, in called functions too."""
    is_scalar, count = function.is_a("SXFunction"), 0
    nodes = function.instructions_sx() if is_scalar else None
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        if operation == ca.OP_CALL:
            node = nodes[k] if nodes is not None else function.instruction_MX(k)
            count += _operations(node.which_function())
        elif operation not in (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST):
            count += 1 if is_scalar else function.instruction_MX(k).nnz()
    return count


def test_a_hull_with_the_corners_of_a_box_is_a_box() -> None:
    box = SHAPES["box"]
    hull = ConvexHull(np.asarray(box.core.vertices))  # type: ignore[attr-defined] it has one
    for first in ("point", "capsule", "box", "hull"):
        for pose in poses(np.random.default_rng(6), 5, 0.7):
            body = SHAPES[first].at(pose[:3])
            assert numeric(body, hull) == pytest.approx(numeric(body, box), abs=1e-12)


@pytest.mark.parametrize("angle", [1e-5, 9e-7, 1e-8, -1e-8, -9e-7, -1e-5])
def test_rods_that_are_nearly_parallel(angle: float) -> None:
    """The end that tilts downwards is the nearest: 1 - sin(angle) or 1 + sin(angle)."""
    a = ca.SX.sym("angle")
    c, s = ca.cos(a), ca.sin(a)
    tilted = ca.vertcat(ca.horzcat(c, 0, -s), ca.horzcat(0, 1, 0), ca.horzcat(s, 0, c))
    rod = Capsule([-1.0, 0, 0], [1.0, 0, 0], 0.1)
    gap = distance(rod.at([0, 0, 1.2], tilted), Capsule([-3.0, 0, 0], [3.0, 0, 0], 0.1))
    value, slope = ca.Function("gap", [a], [gap, ca.jacobian(gap, a)])(angle)
    assert float(value) == pytest.approx(1.0 - np.sin(abs(angle)), abs=1e-14)
    assert float(slope) == pytest.approx(-np.sign(angle), abs=1e-4)
