"""The covariance of estimates: closed forms, finite differences, and what data do not tell."""

import casadi as ca
import numpy as np
import pytest

from ocp import (
    OCP,
    Box,
    Constraint,
    Delay,
    Measurement,
    Model,
    ProblemError,
    Signal,
    Unknown,
    UnsupportedProblem,
    estimate,
    solve,
)
from solvers import Collocation, MultipleShooting

X, Y, K, L = (ca.SX.sym(name) for name in ("x", "y", "k", "l"))
NONE = ca.SX(0, 1)
TIMES = np.array([0.0, 0.4, 1.0, 1.3, 2.0])
SEEN = np.array([0.1, 0.9, 2.2, 2.4, 4.1])


def line(**changes) -> OCP:
    """A straight line: its slope is a constant, its start is free."""
    given = {
        "name": "line",
        "model": Model(name="line", x=X, u=NONE, f=K),
        "x0": [0.0],
        "horizon": 2.0,
        "free_start": ("x",),
        "unknowns": (Unknown("slope", K, 1.0),),
        "data": (Measurement("height", X, TIMES, SEEN, [[0.1], [0.2], [0.1], [0.3], [0.1]]),),
    }
    return OCP(**(given | changes))


def design() -> tuple[np.ndarray, np.ndarray]:
    """Matrix and values of the linear regression, by sigma: slope first, then the start."""
    sigma = np.array([0.1, 0.2, 0.1, 0.3, 0.1])
    return np.stack([TIMES, np.ones(5)], axis=1) / sigma[:, None], SEEN / sigma


@pytest.mark.parametrize("sigma_is_known", [True, False])
def test_a_linear_regression_has_its_closed_form(sigma_is_known):
    found = solve(line(), MultipleShooting(20, tolerance=1e-12)).or_raise()
    result = estimate(found, sigma_is_known=sigma_is_known)
    matrix, values = design()
    expected, rest, _, _ = np.linalg.lstsq(matrix, values)
    scale = 1.0 if sigma_is_known else rest[0] / 3
    assert result.names == ("k", "x(t0)")
    assert result.degrees_of_freedom == 3
    assert result.variance == pytest.approx(scale, rel=1e-9)
    np.testing.assert_allclose(result.values, expected, rtol=1e-8)
    covariance = scale * np.linalg.inv(matrix.T @ matrix)
    np.testing.assert_allclose(result.covariance, covariance, rtol=1e-9)
    np.testing.assert_allclose(result.standard_errors, np.sqrt(np.diag(covariance)), rtol=1e-9)
    assert result.correlation[0, 1] == pytest.approx(
        covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    )
    np.testing.assert_allclose(
        result.residuals["height"].ravel(), matrix @ expected - values, atol=1e-7
    )
    assert str(result).startswith("k = 1.9")


PREY = Model(
    name="prey", x=ca.vertcat(X, Y), u=NONE, f=ca.vertcat(X - K * X * Y, K * X * Y - L * Y)
)


def prey() -> OCP:
    times = np.linspace(0.5, 6.0, 12)
    rng = np.random.default_rng(0)
    seen = np.exp(0.3 * np.sin(times))[:, None] * [[1.2, 0.8]] + 0.05 * rng.normal(size=(12, 2))
    return OCP(
        name="prey",
        model=PREY,
        x0=[1.2, 0.8],
        horizon=6.0,
        free_start=("y",),
        unknowns=(Unknown("bite", K, 1.0, 0.2, 3.0), Unknown("death", L, 1.0, 0.2, 3.0)),
        data=(Measurement("counts", ca.vertcat(X, Y), times, seen, 0.05),),
    )


@pytest.mark.slow
def test_the_covariance_is_that_of_finite_differences():
    ocp = prey()
    found = solve(ocp, Collocation(24)).or_raise()
    result = estimate(found)
    assert result.names == ("k", "l", "y(t0)")
    fixed = OCP(
        name="prey",
        model=PREY,
        x0=[1.2, 0.8],
        horizon=6.0,
        free_start=("y",),
        unknowns=(Unknown("bite", K, 1.0), Unknown("death", L, 1.0)),
        data=ocp.data,
    )
    function = ca.Function("rate", [fixed.model.x, fixed.p], [fixed.model.f])

    def rate(x, theta) -> np.ndarray:
        return np.array(function(x, theta[:2])).ravel()

    def residuals(theta) -> np.ndarray:
        x, rows, h = np.array([1.2, theta[2]]), [], 0.5 / 60
        for _ in range(12):
            for _ in range(60):
                k1 = rate(x, theta)
                k2 = rate(x + h / 2 * k1, theta)
                k3 = rate(x + h / 2 * k2, theta)
                x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + h * k3, theta))
            rows.append(x)
        return ((np.array(rows) - np.asarray(ocp.data[0].values)) / 0.05).ravel()

    step = 1e-5
    sides = [[residuals(result.values + s * step * e) for s in (-1, 1)] for e in np.eye(3)]
    slopes = np.stack([(high - low) / (2 * step) for low, high in sides], axis=1)
    gradient = slopes.T @ residuals(result.values)
    assert np.abs(gradient).max() < 1e-3 * np.abs(slopes).sum()
    expected = np.linalg.inv(slopes.T @ slopes)
    np.testing.assert_allclose(result.covariance, expected, rtol=1e-5)


def test_what_a_bound_holds_has_no_error():
    found = solve(line(unknowns=(Unknown("slope", K, 1.0, 0.0, 1.5),)), Collocation(8)).or_raise()
    result = estimate(found)
    assert result.held == ("k",)
    assert result.standard_errors[0] == 0.0
    np.testing.assert_allclose(
        result.standard_errors[1], (design()[0][:, 1] ** 2).sum() ** -0.5, rtol=1e-8
    )
    assert "k = 1.5, at its bound" in str(result)


def test_controls_and_signals_are_given():
    push, drift = ca.SX.sym("u"), ca.SX.sym("s")
    model = Model(name="pushed", x=X, u=push, f=K * drift + push)
    ocp = line(
        model=model,
        running_cost=push**2,
        control_bounds=Box(-0.1, 0.1),
        parameters=(Signal("drift", drift, [1.0, 1.0, 1.0], hold="linear"),),
    )
    result = estimate(solve(ocp, MultipleShooting(20)).or_raise())
    matrix = design()[0]
    np.testing.assert_allclose(result.covariance, np.linalg.inv(matrix.T @ matrix), rtol=1e-8)


def test_a_delayed_control_is_what_acts():
    push = ca.SX.sym("u")
    ocp = line(
        model=Model(name="steps", x=X, u=push, f=X + K * push, dt=1.0),
        horizon=5,
        free_start=(),
        control_bounds=Box(1.0, 1.0),
        delays=(Delay(push, 1, history=3.0),),
        data=(Measurement("place", X, np.arange(1.0, 6.0), 2.0 * np.arange(3.0, 8.0), 0.1),),
    )
    result = estimate(solve(ocp, MultipleShooting(5)).or_raise())
    assert result.values == pytest.approx([2.0], rel=1e-8)
    slopes = np.arange(3.0, 8.0) / 0.1  # 3 acts in the first step, 1 in each of the others
    assert result.covariance[0, 0] == pytest.approx(1.0 / (slopes @ slopes), rel=1e-8)


def test_a_tiny_constant_is_not_held_by_zero():
    tiny = 1e-9
    ocp = line(
        model=Model(name="slow", x=X, u=NONE, f=K / tiny),
        unknowns=(Unknown("slope", K, tiny, lower=0.0),),
    )
    result = estimate(solve(ocp, Collocation(8)).or_raise())
    assert result.held == ()
    matrix = design()[0] * [1.0 / tiny, 1.0]
    np.testing.assert_allclose(result.covariance, np.linalg.inv(matrix.T @ matrix), rtol=1e-6)


# -- what is refused ----------------------------------------------------------------------------


def test_what_data_do_not_tell_apart_is_named():
    twins = (Unknown("slope", K, 1.0), Unknown("other", L, 1.0))
    ocp = line(model=Model(name="line", x=X, u=NONE, f=K + L), unknowns=twins)
    found = solve(ocp, MultipleShooting(20))
    with pytest.raises(ProblemError, match="the data do not tell k, l apart"):
        estimate(found)
    blind = line(
        model=Model(name="line", x=X, u=NONE, f=0 * L + 1), unknowns=twins[:1], terminal_cost=K**2
    )
    with pytest.raises(ProblemError, match="no data depend on k"):
        estimate(solve(blind, MultipleShooting(20)))


@pytest.mark.parametrize(
    ("changes", "error", "said"),
    [
        ({"data": ()}, ProblemError, "it has no data"),
        (
            {
                "unknowns": (),
                "free_start": (),
                "model": Model(name="l", x=X, u=NONE, f=2.0 + 0 * X),
            },
            ProblemError,
            "neither unknown constants nor a free start",
        ),
        (
            {"constraints": (Constraint("end", X, 4.0, 4.0, at="terminal"),)},
            UnsupportedProblem,
            "terminal constraint 'end' ties",
        ),
        (
            {"data": (Measurement("height", X, [1.0], [2.0]),)},
            ProblemError,
            "1 values measured, 2 estimated",
        ),
    ],
)
def test_no_estimate(changes, error, said):
    given = {"terminal_cost": 1e-3 * K**2} if not changes.get("model") else {}
    found = solve(line(**(given | changes)), MultipleShooting(20))
    with pytest.raises(error, match=said):
        estimate(found)


@pytest.mark.parametrize("given", [3, None, "solution"])
def test_no_solution(given):
    with pytest.raises(ProblemError, match="estimate: solution"):
        estimate(given)
