"""Distances: against brute force, and with a gradient everywhere."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models import Disc, PlanarArm, distance_to_segment, link_distances
from ocp import ProblemError

coordinates = st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6)


def segment_function() -> ca.Function:
    p, a, b = (ca.SX.sym(name, 2) for name in "pab")
    distance = distance_to_segment(p, a, b)
    gradient = ca.gradient(distance, ca.vertcat(p, a, b))
    return ca.Function("distance", [p, a, b], [distance, gradient])


SEGMENT = segment_function()


def distance(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    return float(SEGMENT(p, a, b)[0])


@settings(max_examples=50, deadline=None)
@given(coordinates)
def test_distance_to_a_segment_against_brute_force(numbers: list[float]) -> None:
    p, a, b = np.array(numbers).reshape(3, 2)
    points = a + np.linspace(0.0, 1.0, 20_001)[:, None] * (b - a)
    brute = np.linalg.norm(points - p, axis=1).min()
    assert distance(p, a, b) == pytest.approx(
        brute, abs=float(np.linalg.norm(b - a)) / 20_000 + 1e-8
    )
    assert np.isfinite(np.array(SEGMENT(p, a, b)[1])).all()


@pytest.mark.parametrize(
    ("p", "a", "b"),
    [
        ((0.3, 0.0), (0.0, 0.0), (1.0, 0.0)),  # on the segment
        ((1.0, 0.0), (0.0, 0.0), (1.0, 0.0)),  # at its end
        ((2.0, 1.0), (2.0, 1.0), (2.0, 1.0)),  # a segment of length 0
    ],
)
def test_gradient_is_zero_at_distance_zero(p: tuple, a: tuple, b: tuple) -> None:
    value, gradient = SEGMENT(p, a, b)
    assert float(value) <= 1e-9
    np.testing.assert_array_equal(np.array(gradient), np.zeros((6, 1)))


def test_a_segment_of_length_zero_is_a_point() -> None:
    value, gradient = SEGMENT([3.0, 4.0], [0.0, 0.0], [0.0, 0.0])
    assert float(value) == pytest.approx(5.0)
    np.testing.assert_allclose(np.array(gradient).ravel()[:2], [0.6, 0.8], atol=1e-12)


@pytest.mark.parametrize("p", [(0.4, 0.7), (-0.5, 0.3), (1.4, -0.2)])
def test_gradient_against_finite_differences(p: tuple[float, float]) -> None:
    z, h = np.array([*p, 0.0, 0.1, 1.0, -0.1]), 1e-6
    gradient = np.array(SEGMENT(z[:2], z[2:4], z[4:])[1]).ravel()
    for i, e in enumerate(np.eye(6)):
        ahead, behind = z + h * e, z - h * e
        slope = distance(*ahead.reshape(3, 2)) - distance(*behind.reshape(3, 2))
        assert gradient[i] == pytest.approx(slope / (2 * h), abs=1e-8)


def test_link_distances_are_those_of_the_segments() -> None:
    arm, disc = PlanarArm((1.0, 1.0, 1.0)), Disc([0.4, 1.3], 0.1)
    theta = ca.SX.sym("theta", 3)
    at = [1.3, -1.5, -0.4]
    values = ca.Function("d", [theta], [link_distances(arm, theta, disc)])(at)
    joints = np.array(arm.joints(at)).T
    expected = [distance(np.array([0.4, 1.3]), *joints[i : i + 2]) for i in range(3)]
    np.testing.assert_allclose(np.array(values).ravel(), expected, atol=1e-12)


def test_a_center_may_be_an_expression() -> None:
    t, arm = ca.SX.sym("t"), PlanarArm((1.0, 1.0))
    theta = ca.SX.sym("theta", 2)
    d = link_distances(arm, theta, Disc(ca.vertcat(t, 2.0), 0.1))
    value = ca.Function("d", [theta, t], [d])([0.0, 0.0], 0.5)
    np.testing.assert_allclose(np.array(value).ravel(), [2.0, np.hypot(2.0, 0.5)])


@pytest.mark.parametrize(
    ("center", "radius", "message"),
    [
        ([0.0, 0.0, 0.0], 0.1, "center has 3 entries"),
        ([0.0, np.nan], 0.1, r"center\[1\] is nan"),
        (ca.SX.sym("c", 3), 0.1, r"center has shape \(3, 1\)"),
        ([0.0, 0.0], 0.0, "radius = 0.0, it must be positive"),
        ([0.0, 0.0], -1.0, "radius = -1.0"),
        ([0.0, 0.0], np.nan, "radius = nan"),
    ],
)
def test_bad_discs(center: object, radius: float, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        Disc(center, radius)  # type: ignore[arg-type]
