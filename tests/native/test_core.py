"""The recursion in C by itself: small linear-quadratic steps against a dense KKT system."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ocp import RK4
from ocp.internal import Transcription
from solvers.direct.native.native_library import NativeLibrary
from solvers.direct.native.stage_code import StageCode
from tests.native.problems import swing

N = 4
# Dense elimination against a recursion: systems here have condition numbers up to 1e6.
SAME_STEP = 1e-8


@cache
def library() -> NativeLibrary:
    return NativeLibrary.of(StageCode(Transcription(swing(), N, RK4())))


def filled(seed: int, *, weight: float, indefinite: float = 0.0) -> np.random.Generator:
    """Fill the arrays of a step with random numbers."""
    rng, at = np.random.default_rng(seed), library().arrays
    half = rng.normal(size=at.hessian.shape)
    at.hessian[:] = half @ half.swapaxes(1, 2) / 2 + 0.1 * np.eye(half.shape[1])
    at.hessian[:] -= indefinite * np.eye(half.shape[1])
    for array in (at.slope, at.c_slope, at.rhs, at.gap):
        array[:] = rng.normal(size=array.shape)
    at.sigma[:] = rng.uniform(0.0, weight, size=at.sigma.shape) * rng.integers(0, 2, at.sigma.size)
    at.x_given[:] = rng.integers(0, 2, at.x_given.size)
    at.u_given[:] = rng.integers(0, 2, at.u_given.shape) * rng.integers(0, 2, at.u_given.shape)
    at.c_slope[-_end_rows() :, : _sizes()[1]] = 0.0  # the end has no control
    return rng


def _sizes() -> tuple[int, int]:
    code = library().code
    return code.nx, code.nu


def _end_rows() -> int:
    return library().code.row_counts[2]


def condensed(shift: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return Hessian, gradient, dynamics and their right side of the dense program in all w."""
    code, at = library().code, library().arrays
    nx, nu = _sizes()
    nw, nb = nx + nu, len(code.bounded)
    nc, ni, ne = code.row_counts
    size = N * nw + nx
    own = [np.arange(k * nw, k * nw + (nw if k < N else 0)) for k in range(N + 1)]
    own[N] = np.concatenate([np.full(nu, -1), np.arange(N * nw, size)])
    hessian, gradient = np.zeros((size, size)), np.zeros(size)
    flat, row = 0, 0
    for k in range(N + 1):
        count = ne if k == N else nc + ni if k == 0 else nc
        block = at.hessian[k] + shift * np.eye(nw)
        for b, entry in enumerate(code.bounded):
            block[entry, entry] += at.sigma[flat + b]
        for r in range(count):
            slope = at.c_slope[row + r]
            block = block + at.sigma[flat + nb + r] * np.outer(slope, slope)
        flat, row = flat + nb + count, row + count
        used = own[k] >= 0
        hessian[np.ix_(own[k][used], own[k][used])] += block[np.ix_(used, used)]
        gradient[own[k][used]] += at.rhs[k][used]
    dynamics, right = np.zeros((N * nx, size)), at.gap.ravel().copy()
    for k in range(N):
        dynamics[k * nx : (k + 1) * nx, own[k]] = -at.slope[k]
        dynamics[k * nx : (k + 1) * nx, own[k + 1][nu:]] = np.eye(nx)
    given = np.zeros(size, dtype=bool)
    given[:nw] = np.concatenate([at.u_given[0], at.x_given]) != 0.0
    for k in range(1, N):
        given[k * nw : k * nw + nu] = at.u_given[k] != 0.0
    free = ~given
    return hessian[np.ix_(free, free)], gradient[free], dynamics[:, free], right


@given(st.integers(0, 10_000), st.sampled_from([0.0, 1.0, 1e4]), st.sampled_from([0.0, 0.3]))
@settings(max_examples=60)
def test_the_step_is_that_of_the_dense_system(seed: int, weight: float, shift: float) -> None:
    filled(seed, weight=weight)
    at, (nx, nu) = library().arrays, _sizes()
    hessian, gradient, dynamics, right = condensed(shift)
    assert library().linear_step(shift)
    count = len(right)
    kkt = np.block([[hessian, dynamics.T], [dynamics, np.zeros((count, count))]])
    dense = np.linalg.solve(kkt, np.concatenate([-gradient, right]))
    controls = np.vstack([at.du, np.zeros((1, nu))])
    step = np.hstack([controls, at.dx]).ravel()
    step = np.concatenate([step[: N * (nx + nu)], at.dx[N]])
    given = np.zeros(len(step), dtype=bool)
    given[: nu + nx] = np.concatenate([at.u_given[0], at.x_given]) != 0.0
    for k in range(1, N):
        given[k * (nu + nx) : k * (nu + nx) + nu] = at.u_given[k] != 0.0
    size = 1.0 + np.abs(dense).max()
    np.testing.assert_array_equal(step[given], 0.0)
    np.testing.assert_allclose(step[~given], dense[:-count], atol=SAME_STEP * size)
    # x' - F = gap is multiplied by minus the change of the costate.
    np.testing.assert_allclose(-at.dcostate[1:].ravel(), dense[-count:], atol=SAME_STEP * size)


@given(st.integers(0, 10_000), st.floats(0.0, 3.0))
@settings(max_examples=60)
def test_pivots_tell_whether_the_step_minimises(seed: int, indefinite: float) -> None:
    filled(seed, weight=1.0, indefinite=indefinite)
    hessian, _, dynamics, _ = condensed(0.0)
    _, values, rows = np.linalg.svd(dynamics)
    rank = int((values > 1e-12 * values.max(initial=0.0)).sum())
    null = rows[rank:].T
    curvature = np.linalg.eigvalsh(null.T @ hessian @ null) if null.size else np.ones(1)
    if abs(curvature.min()) < 1e-6 * np.abs(curvature).max():
        return  # neither
    assert library().linear_step(0.0) == bool(curvature.min() > 0.0)


def test_a_number_that_is_not_finite_is_no_pivot() -> None:
    filled(3, weight=1.0)
    library().arrays.hessian[2, 0, 0] = np.nan
    library().arrays.u_given[:] = 0.0
    assert not library().linear_step(0.0)


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_are_those_of_finite_differences(seed: int) -> None:
    at, rng, step = library().arrays, np.random.default_rng(seed), 1e-6
    nx, nu = _sizes()
    tr = library().code.transcription
    p = np.concatenate([[0.2], rng.normal(size=2 * (2 * N + 1))])
    at.data[:] = library().code.data(p)
    at.x[:], at.u[:] = rng.normal(size=(N + 1, nx)), rng.normal(size=(N, nu))
    at.costate[:] = rng.normal(size=at.costate.shape)
    at.y[:], at.z_low[:], at.z_up[:] = rng.normal(size=(3, at.y.size))
    for name in ("z_low", "z_up", "y"):  # a bound's multiplier is no part of these derivatives
        getattr(at, name)[library_bounds()] = 0.0
    costs, slopes, gradients = [], [], []
    for sign in (0, 1, -1):
        for k, i in np.ndindex(N + 1, nu + nx):
            if k == N and i < nu:
                continue
            array, entry = (at.u, i) if i < nu else (at.x, i - nu)
            before = array[k, entry]
            array[k, entry] = before + sign * step
            costs.append(library().evaluate(2))
            slopes.append(at.v.copy())
            gradients.append(library().lagrangian_gradient().copy())
            array[k, entry] = before
    library().evaluate(2)
    here = [at.gradient.copy(), at.hessian.copy()]
    count = len(costs) // 3
    entries = [(k, i) for k, i in np.ndindex(N + 1, nu + nx) if k < N or i >= nu]
    for j, (k, i) in enumerate(entries):
        plus, minus = count + j, 2 * count + j
        assert (costs[plus] - costs[minus]) / (2 * step) == pytest.approx(here[0][k, i], abs=1e-6)
        bent = (gradients[plus][k] - gradients[minus][k]) / (2 * step)
        np.testing.assert_allclose(bent, here[1][k, i], atol=1e-6)
    assert tr.n == N


def library_bounds() -> np.ndarray:
    """Which flat entries are bounds, bool (rows,)."""
    code = library().code
    nc, ni, ne = code.row_counts
    parts = []
    for k in range(N + 1):
        count = ne if k == N else nc + ni if k == 0 else nc
        parts += [np.ones(len(code.bounded), dtype=bool), np.zeros(count, dtype=bool)]
    return np.concatenate(parts)
