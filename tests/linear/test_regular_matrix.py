"""Singular matrices are recognised before a sparse factorisation meets them."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from ocp import Box, Guess, Status, solve
from solvers import IndirectShooting
from solvers.indirect.newton_system import factorised
from solvers.linear.qp.multiplier_space import MultiplierSpace
from solvers.linear.qp.quadratic_program import QP
from solvers.linear.regular_matrix import is_regular
from tests.solvers.problems import ends, point


def banded(n: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    matrix = sum(np.diag(rng.normal(size=n - abs(k)), k) for k in range(-3, 4))
    order = rng.permutation(n)
    return np.asarray(matrix)[order][:, order] + 8.0 * np.eye(n)


@settings(deadline=None, max_examples=25)
@given(n=st.integers(4, 60), seed=st.integers(0, 99), powers=st.integers(0, 9))
def test_units_of_rows_and_columns_do_not_matter(n, seed, powers):
    rng = np.random.default_rng(seed)
    rows, columns = (10.0 ** rng.uniform(-powers, powers, n) for _ in range(2))
    matrix = rows[:, None] * banded(n, seed) * columns
    assert is_regular(sp.csc_matrix(matrix))
    matrix[:, 0] = 0.0
    assert not is_regular(sp.csc_matrix(matrix))


@pytest.mark.parametrize("n", [12, 400], ids=["dense", "banded"])
@pytest.mark.parametrize("fault", ["zero row", "zero column", "dependent row", "nan"])
def test_a_singular_jacobian_has_no_step(n, fault):
    matrix = banded(n, 1)
    match fault:
        case "zero row":
            matrix[3] = 0.0
        case "zero column":
            matrix[:, 3] = 0.0
        case "dependent row":
            matrix[3] = 2.0 * matrix[5]
        case "nan":
            matrix[3, 3] = np.nan
    jacobian = sp.csc_matrix(matrix)
    assert not is_regular(jacobian)
    step = factorised(jacobian)(np.ones(n))
    # Of two rows that depend on each other rounding may leave a pivot: then the step is huge.
    assert not np.isfinite(step).all() or np.abs(step).max() > 1e10


def test_a_regular_jacobian_is_solved():
    for n in (12, 400):
        matrix = banded(n, 2)
        right = np.arange(n, dtype=float)
        step = factorised(sp.csc_matrix(matrix))(right)
        np.testing.assert_allclose(matrix @ step, right, atol=1e-9)


def test_a_program_without_curvature_has_no_multiplier_space():
    qp = QP.of(sp.csc_matrix((3, 3)), sp.csc_matrix(np.eye(3)))
    qp = qp.with_vectors(np.ones(3), -np.ones(3), np.ones(3))
    with pytest.raises(np.linalg.LinAlgError):
        MultiplierSpace(qp)


def test_newton_says_that_its_matrix_is_singular():
    # The control is on its bound all the time: the end does not answer to the costate.
    bounded = point(
        control_bounds=Box(-1.0, 1.0), constraints=ends(0.5), guess=Guess(costate=[-100.0])
    )
    found = solve(bounded, IndirectShooting(segments=150))
    assert found.status is Status.NO_PROGRESS
    assert "singular" in found.message
