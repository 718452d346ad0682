"""The active-set method on programs whose solution is known, from good and from bad guesses."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from solvers.linear.qp.active_set import ActiveSet
from solvers.linear.qp.quadratic_program import QP, residuals


def program(h, g, matrix, low, high) -> QP:
    empty = QP.of(sp.csc_matrix(np.asarray(h, float)), sp.csc_matrix(np.asarray(matrix, float)))
    return empty.with_vectors(*(np.asarray(v, dtype=float) for v in (g, low, high)))


def known(seed: int, dependent: bool) -> tuple[QP, np.ndarray]:
    """A program made from its solution: multipliers, active rows and slack are chosen first."""
    rng = np.random.default_rng(seed)
    n, rows, active = 8, 24, int(rng.integers(0, 7))
    root, matrix, z = rng.normal(size=(n, n)), rng.normal(size=(rows, n)), rng.normal(size=n)
    if dependent:
        matrix[-4:] = matrix[:4]
    side = np.zeros(rows)
    side[rng.permutation(rows)[:active]] = rng.choice([-1.0, 1.0], size=active)
    y, value = side * rng.uniform(0.1, 100.0, size=rows), matrix @ z
    low = np.where(side < 0, value, value - rng.uniform(0.01, 5.0, size=rows))
    high = np.where(side > 0, value, value + rng.uniform(0.01, 5.0, size=rows))
    equation = rng.integers(rows)
    low[equation] = high[equation] = value[equation]
    h = root @ root.T + 0.1 * np.eye(n)
    return program(h, -(h @ z + matrix.T @ y), matrix, low, high), z


@given(seed=st.integers(0, 10_000), guess=st.sampled_from([0.0, 1.0, 1e3]), dependent=st.booleans())
@settings(max_examples=60, deadline=None)
def test_it_finds_the_solution_from_any_guess(seed, guess, dependent):
    qp, z = known(seed, dependent)
    rng = np.random.default_rng(seed + 1)
    start = z + guess * rng.normal(size=z.shape), guess * rng.normal(size=qp.l.shape)
    found = ActiveSet().refine(qp, *start)
    assert max(found.residuals) <= 1e-10
    assert found.residuals == residuals(qp, found.z, found.y)
    np.testing.assert_allclose(found.z, z, atol=1e-7)


def test_what_is_kept_from_the_last_program_does_not_disturb_the_next():
    active = ActiveSet()
    first, _ = known(3, False)
    for shift in (0.0, 1.0, -2.0, 0.0):
        qp = first.with_vectors(first.g + shift, first.l, first.u)
        found = active.refine(qp, np.zeros(8), np.zeros(24))
        alone = ActiveSet().refine(qp, np.zeros(8), np.zeros(24))
        assert max(found.residuals) <= 1e-10
        np.testing.assert_allclose(found.z, alone.z, atol=1e-9)
    other, z = known(4, False)
    np.testing.assert_allclose(active.refine(other, 0 * z, np.zeros(24)).z, z, atol=1e-7)


def test_an_equation_more_is_noticed():
    qp = program(np.eye(2), [-3.0, 0.0], np.eye(2), [-1.0, -1.0], [1.0, 1.0])
    active = ActiveSet()
    nothing = np.zeros(2), np.zeros(2)
    assert active.refine(qp, *nothing).z == pytest.approx([1.0, 0.0])
    fixed = qp.with_vectors(qp.g, np.array([0.5, -1.0]), np.array([0.5, 1.0]))
    found = active.refine(fixed, *nothing)
    assert found.z == pytest.approx([0.5, 0.0])
    assert found.y == pytest.approx([2.5, 0.0])


def test_without_a_solution_the_guess_comes_back():
    contradiction = [[1.0, 1.0], [1.0, 1.0]]
    qp = program(np.eye(2), [0.0, 0.0], contradiction, [1.0, -9.0], [9.0, 0.0])
    found = ActiveSet().refine(qp, np.array([0.3, 0.2]), np.zeros(2))
    assert found.z == pytest.approx([0.3, 0.2])
    assert found.residuals.primal > 0.1


def test_two_equal_equations_do_no_harm():
    twice = program(np.eye(2), [-1.0, -3.0], [[1, 1], [1, 1], [0, 1]], [2, 2, -9], [2, 2, 1.0])
    found = ActiveSet().refine(twice, np.zeros(2), np.zeros(3))
    assert max(found.residuals) <= 1e-9
    assert found.z == pytest.approx([1.0, 1.0])
