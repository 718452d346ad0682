"""Estimations once more without the toolkit: least squares and standard errors by scipy."""

from collections.abc import Callable
from functools import cache

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import OptimizeResult, least_squares

from benchmarks.cases import LIBRARY
from models.textbook import alpha_pinene, gas_oil, marine_population, methanol
from models.textbook.hiv import LOADS
from models.textbook.hiv import TIMES as HIV_TIMES
from models.textbook.kinetics import (
    GAS_OIL,
    GAS_OIL_TIMES,
    METHANOL,
    METHANOL_TIMES,
    PINENE,
    PINENE_TIMES,
)
from models.textbook.marine_population import COUNTS
from ocp import OCP, estimate, solve
from solvers import Collocation
from tests.tolerances import CERTIFIED, DERIVATIVE, ROUNDING

CASES = {case.name: case for case in LIBRARY}
_FIT = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "x_scale": "jac", "jac": "3-point"}


def pinene(k: np.ndarray) -> np.ndarray:
    """All percentages, by the exponential of the matrix of rates."""
    a, b, c, d, e = 1e-5 * k
    rates = np.zeros((5, 5))
    rates[0, 0], rates[1, 0], rates[2, 0] = -a - b, a, b
    rates[2, 2], rates[3, 2], rates[4, 2] = -c - d, c, d
    rates[2, 4], rates[4, 4] = e, -e
    return np.stack([100.0 * expm(t * rates)[:, 0] for t in PINENE_TIMES])


def stages(z: np.ndarray) -> np.ndarray:
    """Thousands in all eight stages, from rates of growth and mortality and the start."""
    growth, mortality, x = z[:7], z[7:15], z[15:]
    rates = np.diag(growth, -1) - np.diag(np.append(growth, 0.0) + mortality)
    step = expm(0.5 * rates)
    rows = [x]
    for _ in range(20):
        rows.append(step @ rows[-1])
    return np.stack(rows)


def integrated(rate: Callable, start: list[float], times: np.ndarray) -> np.ndarray:
    span = (0.0, times[-1])
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    return solve_ivp(rate, span, start, t_eval=times, **options).y.T


def cracked(k: np.ndarray) -> np.ndarray:
    def rate(t: float, y: np.ndarray) -> list[float]:
        return [-(k[0] + k[2]) * y[0] ** 2, k[0] * y[0] ** 2 - k[1] * y[1]]

    return integrated(rate, [1.0, 0.0], GAS_OIL_TIMES)


def carbene_gone(y: np.ndarray, k: np.ndarray) -> list[float]:
    """Methanol's rates as [Dolan, More & Munson 2004] print them, the carbene eliminated."""
    over = (k[1] + k[4]) * y[0] + y[1]
    return [
        -(2.0 * k[1] - k[0] * y[1] / over + k[2] + k[3]) * y[0],
        k[0] * y[0] * (k[1] * y[0] - y[1]) / over + k[2] * y[0],
        k[0] * y[0] * (y[1] + k[4] * y[0]) / over + k[3] * y[0],
    ]


def converted(k: np.ndarray) -> np.ndarray:
    return integrated(lambda t, y: carbene_gone(y, k), [1.0, 0.0, 0.0], METHANOL_TIMES)


def loads(k: np.ndarray) -> np.ndarray:
    """log10 of the viral load, with its logarithm as the state."""
    rate = 10.0**k

    def change(t: float, z: np.ndarray) -> list[float]:
        healthy, infected, virus = z[0], z[1], np.exp(z[2])
        new = rate[2] * healthy * virus
        grown = -rate[2] * healthy - rate[4] + 100.0 * infected / virus
        return [rate[0] - rate[1] * healthy - new, new - rate[3] * infected, grown]

    curve = integrated(change, [1e6, 0.0, np.log(100.0)], HIV_TIMES)
    return curve[:, 2] / np.log(10.0)


# case: the curves, what was measured, a first guess.
FITS: dict[str, tuple[Callable, np.ndarray, np.ndarray]] = {
    "alpha-pinene": (pinene, PINENE, np.array([5.0, 3.0, 2.0, 20.0, 5.0])),
    "gas-oil": (cracked, GAS_OIL, np.full(3, 5.0)),
    "methanol": (converted, METHANOL, np.array([1.8, 2.2, 1.9, 1.8, 0.01])),
    "marine-population": (
        stages,
        COUNTS / 1e3,
        np.concatenate([np.full(7, 0.5), np.full(8, 0.1), COUNTS[0] / 1e3]),
    ),
}


@cache
def fitted(name: str) -> OptimizeResult:
    curves, measured, guess = FITS[name]
    return least_squares(
        lambda k: (curves(k) - measured).ravel(), guess, bounds=(0.0, np.inf), **_FIT
    )


_QUICK = ("gas-oil", "methanol")
_NAMES = [n if n in _QUICK else pytest.param(n, marks=pytest.mark.slow) for n in FITS]


@pytest.mark.parametrize("name", _NAMES)
def test_least_squares_of_scipy_are_the_reference(name: str) -> None:
    reference = CASES[name].reference
    assert reference is not None
    assert 2.0 * fitted(name).cost == pytest.approx(
        reference.value, abs=reference.error, rel=CERTIFIED
    )


@pytest.mark.slow
def test_the_infection_costs_its_reference_in_a_flat_valley() -> None:
    reference = CASES["hiv"].reference
    best = np.array([5.51232818, -0.90333438, -6.49473444, 1.1452756, -0.40659862])

    def cost(k: np.ndarray) -> float:
        return float(((loads(k) - LOADS) ** 2).sum())

    assert reference is not None
    assert cost(best) == pytest.approx(reference.value, abs=reference.error, rel=CERTIFIED)
    for step in 1e-3 * np.eye(5):
        assert min(cost(best - step), cost(best + step)) > reference.lower
    local = np.array([5.51759325, -0.44222757, -6.68126263, 0.1204245, 0.55004322])
    assert cost(local) == pytest.approx(CASES["hiv"].local_costs[0], rel=1e-6)
    printed = np.array([5.0, -0.838, -6.799, -0.376, 0.700])
    assert cost(printed) == pytest.approx(CASES["hiv"].published[0].value, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "build"),
    [
        ("gas-oil", gas_oil),
        pytest.param("alpha-pinene", alpha_pinene, marks=pytest.mark.slow),
    ],
)
def test_standard_errors_are_those_of_the_regression(name: str, build: Callable[[], OCP]) -> None:
    """sigma is not known: it is estimated from the residuals, here and there."""
    result = estimate(solve(build(), Collocation(40)).or_raise(), sigma_is_known=False)
    found = fitted(name)
    freedom = found.jac.shape[0] - found.jac.shape[1]
    if name == "gas-oil":  # its residuals at the start are 0 whatever the rates are
        assert result.degrees_of_freedom == 42 - 3
    assert result.degrees_of_freedom == freedom
    covariance = 2.0 * found.cost / freedom * np.linalg.inv(found.jac.T @ found.jac)
    np.testing.assert_allclose(result.values, found.x, rtol=1e-5)
    np.testing.assert_allclose(result.covariance, covariance, rtol=1e-4)
    np.testing.assert_allclose(result.standard_errors, np.sqrt(np.diag(covariance)), rtol=1e-4)


def test_the_carbene_is_eliminated_as_printed() -> None:
    whole, rng = methanol(), np.random.default_rng(0)
    ocp = whole.explicit
    f = ca.Function("f", [ocp.model.x, ocp.p], [ocp.model.f])
    for _ in range(5):
        y, k = rng.uniform(0.1, 1.0, 3), rng.uniform(0.5, 3.0, 5)
        np.testing.assert_allclose(
            np.array(f(y, k)).ravel(), carbene_gone(y, k), rtol=100 * ROUNDING
        )


def test_the_tables_are_whole() -> None:
    """What the sources print beside the tables: sums, sizes, first rows."""
    assert (PINENE.shape, GAS_OIL.shape, METHANOL.shape) == ((8, 5), (21, 2), (17, 3))
    assert COUNTS.shape == (21, 8)
    np.testing.assert_allclose(PINENE.sum(axis=1), 100.0, atol=0.5)
    assert (np.diff(PINENE[:, 0]) < 0.0).all()
    assert (np.diff(METHANOL[:, 0]) < 0.0).all()
    assert (np.diff(COUNTS[:, :2], axis=0) <= 0.0).all()
    assert marine_population().start().sum() == pytest.approx(93.0, abs=DERIVATIVE)
