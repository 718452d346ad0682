"""The error of an orientation: the logarithm of a rotation, against SciPy, and its derivatives."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.robot import rotation_error
from models.robot.orientation import angle_over_sine
from ocp import ProblemError
from tests.tolerances import DERIVATIVE, ROUNDING, STEP

ANGLES = (0.0, 1e-12, 1e-8, 1e-4, 0.1, 0.19, 0.21, 0.5, 1.5, 3.0)


def turned(vector: np.ndarray) -> np.ndarray:
    return Rotation.from_rotvec(vector).as_matrix()


def error_between(desired: np.ndarray, actual: np.ndarray) -> np.ndarray:
    entries = ca.SX.sym("R", 3, 3)
    return np.array(ca.Function("e", [entries], [rotation_error(desired, entries)])(actual)).ravel()


@pytest.mark.parametrize("angle", ANGLES)
def test_it_is_the_turn_from_one_to_the_other(angle: float) -> None:
    rng = np.random.default_rng(3)
    axis = rng.normal(size=3)
    turn = angle * axis / np.linalg.norm(axis)
    desired = turned(rng.normal(size=3))
    np.testing.assert_allclose(
        error_between(desired, desired @ turned(turn)), turn, rtol=0.0, atol=10 * ROUNDING
    )


@pytest.mark.parametrize("angle", [a for a in ANGLES if a < 3.0])
def test_first_and_second_derivatives_are_finite_and_right(angle: float) -> None:
    """Along R(s) = R_d exp(s e) the error is s e: rate e, and no second derivative."""
    s = ca.SX.sym("s")
    z = ca.vertcat(0.0, 0.0, 1.0)
    actual = ca.vertcat(
        ca.horzcat(ca.cos(s), -ca.sin(s), 0.0),
        ca.horzcat(ca.sin(s), ca.cos(s), 0.0),
        ca.horzcat(0.0, 0.0, 1.0),
    )
    error = rotation_error(np.eye(3), actual)
    rate = ca.jacobian(error, s)
    both = ca.Function("both", [s], [rate, ca.jacobian(rate, s)])
    first, second = both(angle)
    # Digits are lost towards half a turn: derivatives of the factor grow there.
    np.testing.assert_allclose(np.array(first), np.array(z), rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(np.array(second), 0.0, atol=1e-9)


def test_its_gradient_agrees_with_differences_off_the_axis() -> None:
    rng = np.random.default_rng(5)
    desired, w = turned(rng.normal(size=3)), rng.normal(size=3)
    entries = ca.SX.sym("R", 3, 3)
    slope = ca.Function("J", [entries], [ca.jacobian(rotation_error(desired, entries), entries)])
    actual, hat = turned(rng.normal(size=3)), np.cross(np.eye(3), w)
    moved = [actual @ turned(side * STEP * w) for side in (1, -1)]
    measured = (error_between(desired, moved[0]) - error_between(desired, moved[1])) / (2 * STEP)
    computed = np.array(slope(actual)) @ (actual @ hat).flatten(order="F")
    np.testing.assert_allclose(computed, measured, atol=DERIVATIVE)


def test_series_and_closed_form_meet() -> None:
    x = ca.SX.sym("x")
    values = ca.Function("f", [x], [angle_over_sine(x)])
    below, above = float(values(0.01 - 1e-12)), float(values(0.01))
    assert below == pytest.approx(above, abs=1e-11)


def test_at_half_a_turn_there_is_no_number() -> None:
    half = np.diag([-1.0, -1.0, 1.0])
    assert not np.isfinite(error_between(np.eye(3), half)).all()


def test_matrices_of_another_shape_are_named() -> None:
    with pytest.raises(ProblemError, match=r"desired has shape \(2, 2\), \(3, 3\) is needed"):
        rotation_error(np.eye(2), ca.SX.eye(3))
