"""Integrators by their measured order, stages by finite differences."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ocp import (
    OCP,
    RK4,
    Euler,
    Integrator,
    Midpoint,
    Model,
    ProblemError,
    Radau,
    UnsupportedProblem,
    evaluate,
    solve,
)
from ocp.integration.one_step import Stage
from solvers import Collocation, IndirectShooting, MultipleShooting, StagewiseNewton
from tests.ocp.differences import gradient
from tests.ocp.problems import DURATION, lag, pendulum
from tests.tolerances import DERIVATIVE, ORDER, ROUNDING

U0, U1 = np.array([0.4, -1.1]), np.array([-0.3, 0.8])
P0, P1 = np.array([0.8, 0.5, 0.1]), np.array([0.8, 0.5, -0.4])


def reference() -> np.ndarray:
    """Return (x, cost) at the end under linear controls and parameters, by scipy's DOP853."""
    functions = pendulum().functions

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        s = t / DURATION
        now = (z[:2], U0 + s * (U1 - U0), t, P0 + s * (P1 - P0))
        return np.append(np.array(functions.rate(*now)), float(functions.running_cost(*now)))

    start = np.append(pendulum().start(), 0.0)
    return solve_ivp(rate, (0, DURATION), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


def rolled(integrator: Integrator, n: int) -> np.ndarray:
    """Return (x, cost) at the end by n steps."""
    step = Stage.of(pendulum(), integrator, held=False).step
    x, cost, s = pendulum().start(), 0.0, np.linspace(0.0, 1.0, n + 1)
    u, p = U0 + s[:, None] * (U1 - U0), P0 + s[:, None] * (P1 - P0)
    for k in range(n):
        x, c = step(x, u[k], u[k + 1], s[k] * DURATION, DURATION / n, p[k], p[k + 1])
        cost += float(c)
    return np.append(np.array(x).ravel(), cost)


@pytest.mark.parametrize(
    "integrator", [Euler(), Midpoint(), RK4(), Radau(stages=1), Radau(stages=2)], ids=repr
)
def test_order(integrator: Integrator) -> None:
    exact = reference()
    counts = np.array([8, 16, 32]) if isinstance(integrator, Radau) else np.array([16, 32, 64])
    errors = [np.abs(rolled(integrator, n) - exact).max() for n in counts]
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(integrator.order, abs=ORDER)


@pytest.mark.parametrize("kind", [Euler, Midpoint, RK4])
def test_substeps_are_steps(kind: type[Integrator]) -> None:
    np.testing.assert_allclose(rolled(kind(steps=3), 4), rolled(kind(), 12), rtol=1e2 * ROUNDING)


def test_refuses_no_steps() -> None:
    with pytest.raises(ProblemError, match="at least 1, not 0"):
        RK4(steps=0)


@pytest.mark.parametrize("integrator", [Euler(), Midpoint(2), RK4(), Radau(2, stages=3)], ids=repr)
@pytest.mark.parametrize("held", [True, False])
def test_adjoint_is_the_derivative_of_the_step(integrator: Integrator, held: bool) -> None:
    stage = Stage.of(pendulum(), integrator, held=held)
    costate, x, t, h = np.array([0.3, -2.0]), np.array([0.7, -0.2]), 0.4, 0.3
    controls = [U0] if held else [U0, U1]

    def total(v: np.ndarray) -> float:
        us = np.split(v[2:], len(controls))
        after, cost = stage.step(v[:2], *us, t, h, P0, P1)
        return float(cost) + float(costate @ np.array(after).ravel())

    got = np.concatenate(
        [np.array(g).ravel() for g in stage.adjoint(costate, x, *controls, t, h, P0, P1)]
    )
    np.testing.assert_allclose(
        got, gradient(total, np.concatenate([x, *controls])), atol=DERIVATIVE
    )


def test_a_discrete_step_knows_no_h() -> None:
    stage = Stage.of(lag(), RK4(), held=True)
    none = np.empty(0)
    for h in (0.1, 99.0):
        x, cost = stage.step(2.0, 3.0, 0.0, h, none, none)
        assert (float(x), float(cost)) == (0.5 * 2.0 + 3.0, 2.0**2 + 3.0**2)
    before, slope = stage.adjoint(5.0, 2.0, 3.0, 0.0, 0.1, none, none)
    assert (float(before), float(slope)) == (2 * 2.0 + 0.5 * 5.0, 2 * 3.0 + 5.0)


def stiff() -> OCP:
    """Van der Pol's oscillator, whose speed dies out in 7 ms: for RK4 steps of 50 ms are long."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    f = ca.vertcat(x[1], 50 * (1 - x[0] ** 2) * x[1] - x[0] + u)
    model = Model(name="relaxation", x=x, u=u, f=f)
    return OCP(name="stiff", model=model, x0=[2, 0], horizon=1.0, running_cost=ca.sumsqr(x) + u**2)


def test_stiff_dynamics_are_shot_as_they_are_collocated() -> None:
    """The stages of Radau IIA are the points of collocation."""
    collocated = solve(stiff(), Collocation(20, degree=3)).or_raise()
    for solver in (
        MultipleShooting(20, integrator=Radau()),
        MultipleShooting(20, integrator=Radau(), backend="fatrop"),
        MultipleShooting(20, integrator=Radau(), compiled=True),
    ):
        shot = solve(stiff(), solver)
        assert shot.status.is_success, shot.message
        assert abs(evaluate(shot).cost - collocated.cost) < 1e-4


def test_a_lag_is_damped_at_any_step() -> None:
    """L-stable: what is infinitely fast is gone after one step."""
    for stages in (1, 2, 3, 4, 5):
        after = Radau(stages=stages)(lambda z, s: -1e9 * z, ca.SX(1.0), 0.0, 1.0)
        assert abs(float(after)) < 1e-6


def test_linear_dynamics_need_no_root() -> None:
    z = ca.SX.sym("z", 2)
    after = Radau()(lambda y, s: ca.vertcat(y[1], -4 * y[0]) + s, z, 0.0, 0.1)
    assert "root" not in str(after)


def test_what_needs_the_slopes_one_by_one_refuses_it() -> None:
    for solver in (
        StagewiseNewton(20, integrator=Radau()),
        IndirectShooting(integrator=Radau()),
        MultipleShooting(20, integrator=Radau(), backend="native"),
    ):
        with pytest.raises(UnsupportedProblem, match="explicit integrators, not Radau"):
            solver.build(pendulum())


@pytest.mark.parametrize("stages", [0, 6, 1.5, "two"])
def test_refuses_other_numbers_of_stages(stages: object) -> None:
    with pytest.raises(ProblemError, match="stages"):
        Radau(stages=stages)  # pyright: ignore[reportArgumentType]
