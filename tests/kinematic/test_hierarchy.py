"""Tasks in strict order: against quadratic programs, and against the thesis' formulas."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from qpsolvers import solve_qp

from ocp import ProblemError
from solvers import Damped, Exact, Filtered
from solvers.kinematic.hierarchy import Level, prioritised_velocity
from solvers.kinematic.pseudo_inverse import Inverse

# The issue: 3.11 against a QP, and the first task against whatever the second is.
QP = 1e-9
PRIORITY = 1e-10


def drawn(seed: int, n: int, rows: list[int]) -> list[Level]:
    rng = np.random.default_rng(seed)
    return [Level(rng.normal(size=(m, n)), rng.normal(size=m), 1.0, Exact()) for m in rows]


def lexicographic(levels: list[Level], n: int) -> np.ndarray:
    """The least dq that does each task as well as those above it allow, by KKT systems."""
    a, b = np.empty((0, n)), np.empty(0)
    for level in levels:
        # min |J x - r|^2 subject to A x = b; the null space of A is explicit.
        x0 = np.linalg.lstsq(a, b)[0] if len(a) else np.zeros(n)
        basis = np.linalg.svd(a)[2][np.linalg.matrix_rank(a) if len(a) else 0 :].T
        z = np.linalg.lstsq(level.jacobian @ basis, level.desired_velocity - level.jacobian @ x0)[0]
        a, b = np.vstack([a, level.jacobian]), np.append(b, level.jacobian @ (x0 + basis @ z))
    return np.linalg.lstsq(a, b)[0]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(3, 12), st.lists(st.integers(1, 3), max_size=4))
def test_least_squares_in_strict_order(seed: int, n: int, rows: list[int]) -> None:
    """Also where the tasks have more rows together than there are joints."""
    levels = drawn(seed, n, [2, *rows])
    dq = prioritised_velocity(levels, n, decoupled=True)
    expected = lexicographic(levels, n)
    # Two ways round the same nearly singular J N differ by rounding times its inverse squared.
    scale = 1.0 + np.abs(expected).max() ** 2
    np.testing.assert_allclose(dq, expected, atol=QP * scale)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(("n", "rows"), [(3, [2, 1]), (4, [2, 2]), (7, [3, 2]), (12, [2, 3])])
def test_two_tasks_are_a_quadratic_program(seed: int, n: int, rows: list[int]) -> None:
    """(3.11) is the least dq that does both: min |x|^2 with J1 x = r1, J2 x = r2."""
    levels = drawn(seed, n, rows)
    a = np.vstack([level.jacobian for level in levels])
    b = np.concatenate([level.desired_velocity for level in levels])
    x = solve_qp(np.eye(n), np.zeros(n), A=a, b=b, solver="quadprog")
    assert x is not None
    dq = prioritised_velocity(levels, n, decoupled=True)
    np.testing.assert_allclose(dq, x, atol=QP * (1.0 + np.abs(x).max()))


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("alpha", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("inverse", [Exact(), Damped(0.1), Filtered(0.1, 0.5)])
def test_the_formula_of_the_thesis(seed: int, alpha: float, inverse: Inverse) -> None:
    """(3.16) with (3.17) written out, N = E - J#J with the damped inverse."""
    first, second = drawn(seed, 3, [2, 1])
    j1, j2 = first.jacobian, second.jacobian

    def sharp(j: np.ndarray) -> np.ndarray:
        u, s, vt = np.linalg.svd(j, full_matrices=False)
        return vt.T @ np.diag(inverse.gains(s)) @ u.T

    n1 = np.eye(3) - sharp(j1) @ j1
    dq1 = sharp(j1) @ first.desired_velocity
    expected = dq1 + alpha * sharp(j2 @ n1) @ (second.desired_velocity - j2 @ dq1)
    levels = [first._replace(inverse=inverse), second._replace(inverse=inverse, activation=alpha)]
    dq = prioritised_velocity(levels, 3, decoupled=False)
    np.testing.assert_allclose(dq, expected, atol=1e-10)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 10_000),
    st.floats(0.0, 1.0),
    st.sampled_from([Exact(), Damped(0.05), Filtered(0.05, 0.3)]),
)
def test_the_first_task_never_notices_the_others(seed: int, alpha: float, inverse: Inverse) -> None:
    first, *others = [level._replace(inverse=inverse) for level in drawn(seed, 6, [2, 2, 1])]
    others = [level._replace(activation=alpha) for level in others]
    alone = first.jacobian @ prioritised_velocity([first], 6, decoupled=True)
    among = first.jacobian @ prioritised_velocity([first, *others], 6, decoupled=True)
    np.testing.assert_allclose(among, alone, atol=PRIORITY)


def test_with_the_damped_inverse_in_the_null_space_it_does_notice() -> None:
    first, second = [level._replace(inverse=Damped(0.3)) for level in drawn(1, 3, [2, 1])]
    alone, among = (
        first.jacobian @ prioritised_velocity(levels, 3, decoupled=False)
        for levels in ([first], [first, second])
    )
    assert np.abs(among - alone).max() > 1e-3


def test_an_inactive_task_takes_no_redundancy() -> None:
    first, second, third = drawn(5, 4, [2, 2, 1])
    off = [first, second._replace(activation=0.0), third]
    np.testing.assert_allclose(
        prioritised_velocity(off, 4, decoupled=True),
        prioritised_velocity([first, third], 4, decoupled=True),
        atol=1e-12,
    )


def test_the_answer_is_continuous_while_a_task_in_the_middle_is_switched_on() -> None:
    first, second, third = drawn(5, 4, [2, 1, 1])
    answers = np.array([
        prioritised_velocity([first, second._replace(activation=a), third], 4, decoupled=True)
        for a in np.linspace(0.0, 1.0, 101)
    ])  # fmt: skip
    steps = np.abs(np.diff(answers, axis=0)).max(axis=1)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)


# -- inverses -----------------------------------------------------------------------


def test_damped_inverse_is_that_of_the_thesis() -> None:
    j = np.random.default_rng(0).normal(size=(2, 3))
    u, s, vt = np.linalg.svd(j, full_matrices=False)
    ours = vt.T @ np.diag(Damped(0.2).gains(s)) @ u.T
    np.testing.assert_allclose(ours, j.T @ np.linalg.inv(j @ j.T + 0.04 * np.eye(2)), atol=1e-12)


def test_gains_are_bounded_and_filtered_is_exact_where_it_should() -> None:
    s = np.concatenate([[0.0], np.logspace(-12, 2, 2000)])
    assert Damped(0.05).gains(s).max() <= 1.0 / (2 * 0.05) + 1e-9
    filtered = Filtered(0.05, 0.2).gains(s)
    assert filtered.max() <= 1.0 / (2 * 0.05 * np.sqrt(1.0 - 0.05**2 / 0.2**2)) + 1e-9
    np.testing.assert_allclose(filtered[s >= 0.2], 1.0 / s[s >= 0.2], rtol=1e-12)
    assert np.abs(np.diff(filtered)).max() < 0.2, "no jump at the threshold"
    assert Exact(1e-6).gains(np.array([0.0, 1e-7, 0.5])).tolist() == [0.0, 0.0, 2.0]
    # A large damping must not divide by zero either.
    assert np.isfinite(Filtered(5.0, 0.1).gains(s)).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Exact(0.0), "Exact: tolerance = 0.0"),
        (lambda: Damped(-1.0), "Damped: factor = -1.0"),
        (lambda: Damped(np.nan), "Damped: factor = nan"),
        (lambda: Filtered(0.1, 0.0), "Filtered: threshold = 0.0"),
        (lambda: Filtered("0.1"), "Filtered: factor = '0.1'"),  # type: ignore[arg-type]
    ],
)
def test_bad_inverses(make: Any, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        make()
