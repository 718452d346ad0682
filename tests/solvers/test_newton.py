"""Newton's method on systems small enough to know what has to happen."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solvers.indirect.newton_iteration import NewtonResult, newton
from tests.tolerances import ROUNDING

Function = Callable[[np.ndarray], np.ndarray]


def run(f: Function, jacobian: Function, x: list[float], **options) -> NewtonResult:
    def linearise(x: np.ndarray, _: None) -> Function:
        matrix = jacobian(x)
        if np.linalg.matrix_rank(matrix) < len(x):
            return lambda r: np.full_like(r, np.nan)
        return lambda r: np.linalg.solve(matrix, r)

    settings: dict[str, Any] = {"tolerance": 1e-12, "max_steps": 50, "damped": True} | options
    return newton(lambda x: (f(x), None), linearise, np.array(x), **settings)


def circle(x: np.ndarray) -> np.ndarray:
    """A circle and a line; the root used here is (sqrt 2, sqrt 2)."""
    return np.array([x[0] ** 2 + x[1] ** 2 - 4.0, x[0] - x[1]])


def circle_slope(x: np.ndarray) -> np.ndarray:
    return np.array([[2 * x[0], 2 * x[1]], [1.0, -1.0]])


def bent(x: np.ndarray) -> np.ndarray:
    """Newton's textbook failure: from beyond 1.39 plain iterates of arctan run away."""
    return np.arctan(x)


def bent_slope(x: np.ndarray) -> np.ndarray:
    return np.diag(1.0 / (1.0 + x**2))


def test_converges_quadratically() -> None:
    result = run(circle, circle_slope, [2.0, 1.0])
    assert result.converged
    np.testing.assert_allclose(result.x, np.sqrt(2.0), atol=ROUNDING)
    # residual_(k+1) / residual_k^2 stays bounded until rounding takes over.
    h = result.history[result.history > 1e-10]
    assert len(h) >= 3
    assert np.all(h[1:] <= h[:-1] ** 2)


def test_undamped_steps_are_plain_newton() -> None:
    x = np.array([1.0, 3.0])
    norms = [np.abs(circle(x)).max()]
    for _ in range(4):
        x = x - np.linalg.solve(circle_slope(x), circle(x))
        norms.append(np.abs(circle(x)).max())
    result = run(circle, circle_slope, [1.0, 3.0], damped=False, max_steps=4, tolerance=1e-300)
    np.testing.assert_array_equal(result.history, norms)
    assert (result.steps, result.evaluations) == (4, 5)


def test_damping_succeeds_where_plain_newton_runs_away() -> None:
    with np.errstate(over="ignore"):
        plain = run(bent, bent_slope, [3.0], damped=False, max_steps=6)
    damped = run(bent, bent_slope, [3.0])
    assert not plain.converged
    assert damped.converged
    assert np.all(np.diff(damped.history) < 0.0)
    assert damped.evaluations > damped.steps + 1


def test_the_best_iterate_is_returned() -> None:
    with np.errstate(over="ignore"):
        result = run(bent, bent_slope, [1.5], damped=False, max_steps=5)
    assert result.residual == result.history.min()
    assert np.abs(bent(result.x)).max() == result.residual


def test_a_singular_jacobian_is_no_exception() -> None:
    result = run(circle, circle_slope, [0.0, 0.0])
    assert not result.converged
    assert not result.diverged
    assert result.steps == 0


@pytest.mark.parametrize("damped", [True, False])
def test_nan_at_the_start_diverges(damped: bool) -> None:
    result = run(lambda x: x * np.nan, lambda x: np.eye(1), [1.0], damped=damped)
    assert result.diverged
    assert not result.converged
    assert (result.residual, result.steps) == (np.inf, 0)


def test_nan_on_the_way() -> None:
    """The root of sqrt(x) - 1/10 from 1: a plain step lands at -0.8, half of it at 0.1."""

    def f(x: np.ndarray) -> np.ndarray:
        return np.sqrt(x, where=x >= 0.0, out=np.full_like(x, np.nan)) - 0.1

    def slope(x: np.ndarray) -> np.ndarray:
        return np.diag(0.5 / np.sqrt(x))

    assert run(f, slope, [1.0], damped=False).diverged
    assert run(f, slope, [1.0]).converged


def test_step_limit() -> None:
    result = run(circle, circle_slope, [9.0, 1.0], max_steps=2)
    assert not result.converged
    assert result.steps == 2


@given(
    st.integers(1, 5).flatmap(
        lambda n: st.lists(st.floats(-5, 5), min_size=n * n + n, max_size=n * n + n)
    )
)
def test_a_linear_system_takes_one_step(entries: list[float]) -> None:
    n = int(np.sqrt(len(entries)))
    matrix = 12.0 * n * np.eye(n) + np.array(entries[: n * n]).reshape(n, n)
    right = np.array(entries[n * n :])
    result = run(lambda x: matrix @ x - right, lambda x: matrix, [0.0] * n)
    assert result.converged
    assert result.steps <= 1
