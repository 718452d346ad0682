"""Paths: position, symbolic velocity, and what is refused."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from models import line, path_position, path_velocity
from ocp import ProblemError

T = ca.SX.sym("t")


def value(expression: ca.SX, t: float) -> np.ndarray:
    return np.array(ca.Function("value", [T], [expression])(t)).ravel()


def test_line() -> None:
    path = line([1.0, 2.0], [0.5, -0.25])
    np.testing.assert_allclose(value(path_position(path, T), 2.0), [2.0, 1.5])
    np.testing.assert_allclose(value(path_velocity(path, T), 2.0), [0.5, -0.25])


def test_velocity_of_any_path_against_finite_differences() -> None:
    def path(t: ca.SX) -> ca.SX:
        return ca.vertcat(ca.cos(3.0 * t), t**2 * ca.exp(-t))

    position, h = path_position(path, T), 1e-6
    slope = (value(position, 0.7 + h) - value(position, 0.7 - h)) / (2 * h)
    np.testing.assert_allclose(value(path_velocity(path, T), 0.7), slope, atol=1e-8)


@pytest.mark.parametrize("point", [[1.0, 2.0], (1.0, 2.0), ca.DM([1.0, 2.0])])
def test_a_path_may_stand_still(point: Any) -> None:
    np.testing.assert_allclose(value(path_position(lambda t: point, T), 0.3), [1.0, 2.0])
    np.testing.assert_allclose(value(path_velocity(lambda t: point, T), 0.3), [0.0, 0.0])


def test_bad_paths() -> None:
    there: Any = lambda t: "there"  # noqa: E731
    with pytest.raises(ProblemError, match="start has 3 entries"):
        line([0.0, 0.0, 0.0], [1.0, 0.0])
    with pytest.raises(ProblemError, match=r"velocity\[0\] is nan"):
        line([0.0, 0.0], [np.nan, 0.0])
    with pytest.raises(ProblemError, match=r"shape \(1, 1\)"):
        path_position(lambda t: t, T)
    with pytest.raises(ProblemError, match="returns a str"):
        path_position(there, T)
