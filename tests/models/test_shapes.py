"""Capsules and polygons: signed distances against brute force, moving ones, bad ones."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from models import (
    Capsule,
    Disc,
    Obstacle,
    PlanarArm,
    Polygon,
    link_distances,
    obstacles_from_data,
    signed_distance,
)
from ocp import ProblemError

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
coordinate = st.floats(-2.0, 2.0).map(lambda x: round(x, 6))
ends = st.lists(coordinate, min_size=4, max_size=4).map(lambda z: np.array(z).reshape(2, 2))


def distance_function(count: int) -> ca.Function:
    corners, z = ca.SX.sym("corners", 2, count), ca.SX.sym("z", 4)
    d = signed_distance(corners, z[:2], z[2:])
    return ca.Function("d", [corners, z], [d, ca.gradient(d, z), ca.hessian(d, z)[0]])


FUNCTIONS = {count: distance_function(count) for count in (1, 2, 3, 4, 5)}


def signed(corners: np.ndarray, link: np.ndarray) -> float:
    return float(FUNCTIONS[len(corners)](corners.T, link.ravel())[0])


def brute_force(corners: np.ndarray, link: np.ndarray) -> float:
    """The largest gap between the shadows of both shapes, over all directions.

    By duality it is the distance of two convex shapes, and minus the penetration depth.
    """

    def gaps(angle: np.ndarray) -> np.ndarray:
        normals = np.stack([np.cos(angle), np.sin(angle)])
        return (link @ normals).min(axis=0) - (corners @ normals).max(axis=0)

    angle = np.linspace(0.0, 2.0 * np.pi, 4001)
    width, values = angle[1], gaps(angle)
    peaks = angle[(values >= np.roll(values, 1)) & (values >= np.roll(values, -1))]
    for _ in range(3):  # every local maximum: two may be nearly as high
        near = np.add.outer(peaks, np.linspace(-width, width, 201))
        values = gaps(near.ravel()).reshape(near.shape)
        peaks, width = near[np.arange(len(peaks)), values.argmax(axis=1)], width / 50.0
    return float(values.max())


def ring(count: int, radii: list[float], turn: float) -> np.ndarray:
    """A convex polygon: an affine image of a regular one."""
    angle = turn + 2.0 * np.pi * np.arange(count) / count
    return np.stack([radii[0] * np.cos(angle), radii[1] * np.sin(angle)], axis=1)


@settings(max_examples=150, deadline=None)
@given(st.integers(3, 5), st.lists(st.floats(0.2, 1.5), min_size=2, max_size=2), coordinate, ends)
def test_polygon_against_brute_force(
    count: int, radii: list[float], turn: float, link: np.ndarray
) -> None:
    corners = ring(count, radii, turn)
    assert signed(corners, link) == pytest.approx(brute_force(corners, link), abs=1e-6)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(ends, ends)
def test_capsule_against_brute_force(core: np.ndarray, link: np.ndarray) -> None:
    assume(np.linalg.norm(core[1] - core[0]) > 1e-3)
    assert signed(core, link) == pytest.approx(brute_force(core, link), abs=1e-6)


@settings(max_examples=100, deadline=None)
@given(st.integers(1, 5), st.lists(st.sampled_from([-1.0, 0.0, 0.5, 1.0]), min_size=4, max_size=4))
def test_derivatives_are_finite_everywhere(count: int, z: list[float]) -> None:
    """On corners, along edges, at contact, in the middle, for links of length zero."""
    corners = ring(count, [1.0, 1.0], 0.0)
    for value in FUNCTIONS[count](corners.T, z):
        assert np.isfinite(np.array(value)).all()


@settings(max_examples=50, deadline=None)
@given(st.integers(2, 5), ends)
def test_gradient_against_finite_differences(count: int, link: np.ndarray) -> None:
    corners, h = ring(count, [1.0, 0.7], 0.3), 1e-6
    _, gradient, _ = FUNCTIONS[count](corners.T, link.ravel())
    # Not across a kink: there the two one-sided slopes differ, by more than the curvature does.
    slopes = []
    for e in np.eye(4):
        step = h * e.reshape(2, 2)
        here = signed(corners, link)
        ahead, behind = signed(corners, link + step) - here, here - signed(corners, link - step)
        assume(abs(ahead - behind) < 1e-12)
        slopes.append((ahead + behind) / (2 * h))
    np.testing.assert_allclose(np.array(gradient).ravel(), slopes, atol=1e-6)


def test_at_contact_with_an_edge_the_gradient_points_away() -> None:
    value, gradient, _ = FUNCTIONS[4](SQUARE.T, [1.0, 0.3, 2.0, 0.8])
    assert float(value) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(np.array(gradient).ravel(), [1.0, 0.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("link", "expected"),
    [
        ([[2.0, 0.0], [2.0, 1.0]], 1.0),
        ([[2.0, 2.0], [3.0, 3.0]], np.sqrt(2.0)),
        ([[-1.0, 0.9], [2.0, 0.9]], -0.1),  # through and through
        ([[0.5, 0.5], [0.5, 0.5]], -0.5),  # a point inside
        ([[0.2, 0.5], [0.8, 0.5]], -0.5),  # within
        ([[1.0, 2.0], [2.0, 1.0]], np.sqrt(0.5)),  # corner against the middle of the link
    ],
)
def test_known_distances_from_a_square(link: list, expected: float) -> None:
    assert signed(SQUARE, np.array(link)) == pytest.approx(expected, abs=1e-9)


# -- the shapes ---------------------------------------------------------------------


@pytest.mark.parametrize("tilt", [0.0, 1e-17, -1e-17, 1e-12, 1e-6])
def test_a_capsule_in_line_with_the_link(tilt: float) -> None:
    core, link = np.array([[1.0, tilt], [2.0, -tilt]]), np.array([[0.0, 0.0], [0.5, tilt]])
    assert signed(core, link) == pytest.approx(0.5, abs=1e-9)


SHAPES: list[Obstacle] = [
    Disc([1.5, 0.8], 0.2),
    Capsule([1.2, 0.8], [1.8, 1.1], 0.1),
    Polygon([[1.2, 0.7], [1.8, 0.8], [1.5, 1.2]], 0.05),
]


@pytest.mark.parametrize("obstacle", SHAPES)
def test_links_of_an_arm(obstacle: Obstacle) -> None:
    arm, theta = PlanarArm((1.0, 0.8, 0.6)), np.array([0.9, -0.6, -0.8])
    joints = np.array(arm.joints(theta)).T
    core = np.array(ca.DM(obstacle.core)).T
    expected = [brute_force(core, joints[i : i + 2]) for i in range(3)]
    d = np.array(ca.DM(link_distances(arm, ca.SX(ca.DM(theta)), obstacle))).ravel()
    np.testing.assert_allclose(d, expected, atol=1e-6)


@pytest.mark.parametrize("obstacle", SHAPES)
def test_a_moving_obstacle_is_a_shifted_one(obstacle: Obstacle) -> None:
    t, theta = ca.SX.sym("t"), ca.SX.sym("theta", 2)
    arm, at = PlanarArm((1.0, 1.0)), [0.4, 0.7]
    moving = link_distances(arm, theta, obstacle.moving([0.2, -0.1], t))
    shifted = link_distances(arm, theta, obstacle.moved([0.4, -0.2]))
    later = ca.Function("d", [theta, t], [moving])(at, 2.0)
    np.testing.assert_allclose(
        np.array(later), np.array(ca.Function("d", [theta], [shifted])(at)), atol=1e-12
    )


@pytest.mark.parametrize("obstacle", SHAPES)
def test_outline_is_the_radius_away_from_the_core(obstacle: Obstacle) -> None:
    core, t = np.array(ca.DM(obstacle.core)).T, ca.SX.sym("t")
    for point in obstacle.outline(0.1):
        away = brute_force(core, np.stack([point, point]))
        assert away == pytest.approx(obstacle.radius + 0.1, abs=1e-9)
    drawn = obstacle.moving([1.0, 0.0], t).outline(t=t, at=0.5)
    np.testing.assert_allclose(drawn, obstacle.moved([0.5, 0.0]).outline(), atol=1e-12)


def test_outline_needs_to_know_where_the_obstacle_is() -> None:
    with pytest.raises(ProblemError, match="depends on where_0, where_1"):
        Disc(ca.SX.sym("where", 2), 0.1).outline()


def test_corners_may_go_either_way_round() -> None:
    link = np.array([[2.0, 0.3], [0.6, 2.0]])
    values = [
        float(signed_distance(Polygon(c).core, *map(ca.SX, map(ca.DM, link))))
        for c in (SQUARE, SQUARE[::-1])
    ]
    assert values[0] == pytest.approx(values[1])


PENTAGRAM = ring(5, [1.0, 1.0], 0.0)[[0, 2, 4, 1, 3]]


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ([[0, 0], [1, 0]], r"shape \(2, 2\), \(k >= 3, 2\) is needed"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], r"shape \(3, 3\)"),
        ([[0, 0], [1, 0], [0.2, 0.2], [0, 1]], r"not convex at corner\[2\]"),
        ([[0, 0], [1, 0], [1, 0], [0, 1]], r"corner\[1\] is there twice"),
        ([[0, 0], [1, 0], [2, 0]], "not convex"),
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "not convex"),
        (PENTAGRAM, "not convex"),
        ([[0, 0], [1, np.nan], [0, 1]], "not finite"),
        ("square", "not numeric"),
    ],
)
def test_bad_corners(corners: Any, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        Polygon(corners)


@pytest.mark.parametrize(
    ("start", "end", "radius", "message"),
    [
        ([0, 0], [0, 0], 0.1, "take a Disc"),
        ([0, 0], [0, 1], 0.0, "radius = 0.0, it must be positive"),
        ([0, 0, 0], [0, 1], 0.1, "start has 3 entries"),
        ([0, 0], [0, np.inf], 0.1, r"end\[1\] is inf"),
    ],
)
def test_bad_capsules(start: Any, end: Any, radius: float, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        Capsule(start, end, radius)


def test_a_negative_margin() -> None:
    with pytest.raises(ProblemError, match=r"radius = -0\.1"):
        Polygon(SQUARE, -0.1)


# -- from data ----------------------------------------------------------------------

ROWS: list[dict[str, Any]] = [
    {"shape": "disc", "center": [1, 2], "radius": 0.1},
    {"shape": "capsule", "start": [1, 2], "end": [2, 2], "radius": 0.1},
    {"shape": "polygon", "corners": SQUARE.tolist(), "radius": 0.0, "velocity": [0.5, 0.0]},
]


def test_obstacles_from_data() -> None:
    t = ca.SX.sym("t")
    disc, capsule, polygon = obstacles_from_data(ROWS, t=t)
    assert isinstance(disc, Disc)
    assert isinstance(capsule, Capsule)
    np.testing.assert_allclose(
        polygon.outline(t=t, at=2.0), Polygon(SQUARE).moved([1.0, 0.0]).outline(), atol=1e-12
    )
    assert obstacles_from_data([]) == ()


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"shape": "torus"}, "row 0: shape = 'torus', none of disc, capsule, polygon"),
        ({"center": [0, 0]}, "row 0: shape = None"),
        ({"shape": "disc", "center": [0, 0]}, "missing or unknown: radius"),
        ({**ROWS[0], "color": "red"}, "missing or unknown: color"),
        ({**ROWS[0], "radius": -1}, "row 0: disc: radius = -1, it must"),
        (ROWS[2], "row 0: it moves: pass the symbol of time t"),
        ("disc", "row 0 is a str"),
    ],
)
def test_bad_data(row: Any, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        obstacles_from_data([row])
