"""The arm: kinematics against casadi, finite differences and complex numbers."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models import PlanarArm
from ocp import ProblemError

lengths = st.lists(st.floats(0.05, 3.0), min_size=1, max_size=12)
seeds = st.integers(0, 10_000)


def angles(arm: PlanarArm, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-3.0, 3.0, arm.n)


@pytest.mark.parametrize("links", range(1, 13))
def test_jacobian_is_the_derivative_of_the_end_effector(links: int) -> None:
    rng = np.random.default_rng(links)
    arm = PlanarArm(tuple(rng.uniform(0.2, 2.0, links)), base=(0.3, -0.7))
    theta = ca.SX.sym("theta", links)
    automatic = ca.Function("J", [theta], [ca.jacobian(arm.end_effector(theta), theta)])
    at = rng.uniform(-3.0, 3.0, links)
    closed = np.array(arm.jacobian(at))
    assert closed.shape == (2, links)
    np.testing.assert_allclose(closed, np.array(automatic(at)), atol=1e-12)
    h = 1e-6
    for i, e in enumerate(np.eye(links)):
        ahead, behind = arm.end_effector(at + h * e), arm.end_effector(at - h * e)
        np.testing.assert_allclose(closed[:, [i]], np.array(ahead - behind) / (2 * h), atol=1e-8)


@settings(max_examples=30, deadline=None)
@given(lengths, seeds)
def test_joints_are_sums_of_links_as_complex_numbers(lengths: list[float], seed: int) -> None:
    arm = PlanarArm(tuple(lengths), base=(1.0, 2.0))
    theta = angles(arm, seed)
    joints = np.array(arm.joints(theta))
    links = np.array(lengths) * np.exp(1j * np.cumsum(theta))
    expected = 1.0 + 2.0j + np.concatenate([[0.0], np.cumsum(links)])
    np.testing.assert_allclose(joints[0] + 1j * joints[1], expected, atol=1e-12)
    np.testing.assert_allclose(np.array(arm.end_effector(theta)), joints[:, [-1]])
    np.testing.assert_allclose(arm.positions(theta)[0], joints.T, atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(lengths, st.integers(1, 20), seeds)
def test_positions_of_a_trajectory(lengths: list[float], rows: int, seed: int) -> None:
    arm = PlanarArm(tuple(lengths))
    theta = np.random.default_rng(seed).normal(size=(rows, arm.n))
    points = arm.positions(theta)
    assert points.shape == (rows, arm.n + 1, 2)
    sizes = np.linalg.norm(np.diff(points, axis=1), axis=2)
    np.testing.assert_allclose(sizes, np.tile(lengths, (rows, 1)), atol=1e-12)


def test_symbols_and_numbers_agree() -> None:
    arm = PlanarArm((1.0, 0.5, 0.25))
    kinds: tuple[Any, ...] = (ca.SX, ca.MX)
    for kind in kinds:
        theta = kind.sym("theta", 3)
        value = ca.Function("r", [theta], [arm.end_effector(theta)])([0.1, 0.2, 0.3])
        np.testing.assert_allclose(np.array(value), np.array(arm.end_effector([0.1, 0.2, 0.3])))


def test_reach_has_a_hole_where_one_link_is_the_longest() -> None:
    assert PlanarArm((1.0, 1.0, 1.0)).reach == (0.0, 3.0)
    assert PlanarArm((2.0, 0.5)).reach == (1.5, 2.5)


@pytest.mark.parametrize(
    ("lengths", "message"),
    [
        ((), "no links"),
        ((1.0, 0.0, 1.0), r"link\[1\] is 0.0 m"),
        ((1.0, 1.0, -0.1), r"link\[2\] is -0.1 m"),
        ((np.nan, 1.0), r"link\[0\] is nan"),
        ((1.0, np.inf), r"link\[1\] is inf"),
        (("long",), "not numeric"),
    ],
)
def test_bad_lengths_name_the_link(lengths: tuple, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        PlanarArm(lengths)


def test_bad_base_and_angles() -> None:
    with pytest.raises(ProblemError, match="base has 3 entries"):
        PlanarArm((1.0,), base=(0.0, 0.0, 0.0))  # type: ignore[arg-type]
    arm = PlanarArm((1.0, 1.0))
    with pytest.raises(ProblemError, match="theta has 3 entries, it has 2 links"):
        arm.end_effector([1.0, 2.0, 3.0])
    with pytest.raises(ProblemError, match=r"theta has shape \(4, 3\)"):
        arm.positions(np.zeros((4, 3)))
