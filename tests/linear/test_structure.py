"""What is read off a problem, and what is refused."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from models import LinearPlant, mass_spring_damper, tracking_ocp
from ocp import (
    OCP,
    RK4,
    Box,
    Constraint,
    Model,
    ProblemError,
    Signal,
    UnsupportedProblem,
    discretise,
    evaluate,
    linear_quadratic,
    solve,
)
from ocp.problem.run_data import RunData
from solvers import MultipleShooting, Riccati
from tests.linear.problems import general

X, U = ca.SX.sym("x", 2), ca.SX.sym("u")


def problem(cost=None, *, f=None, **more) -> OCP:
    f = ca.vertcat(X[1], U + X[0]) if f is None else f
    cost = ca.sumsqr(X) + U**2 if cost is None else cost
    model = Model(name="plant", x=X, u=U, f=f, dt=0.1)
    return OCP(name="p", model=model, x0=[1, 1], horizon=5, running_cost=cost, **more)


@pytest.mark.parametrize(
    ("ocp", "message"),
    [
        (
            problem(ca.sin(X[0]) + U**2),
            r"running_cost is not quadratic in x\[0\] \(sin\(x\[0\]\)\)",
        ),
        (problem(ca.fabs(X[1]) + U**2), r"running_cost is not quadratic in x\[1\]"),
        (problem(U**2 + X[0] * X[1] * U), r"running_cost is not quadratic in x\[0\]"),
        (problem(U**2 + ca.if_else(X[0] > 0, X[0], 0)), r"not quadratic in x\[0\]"),
        (problem(terminal_cost=X[1] ** 3), r"terminal_cost is not quadratic in x\[1\]"),
        (problem(f=ca.vertcat(X[1], X[0] * U)), r"f\[1\] is not linear in x\[0\]"),
        (problem(f=ca.vertcat(X[1], U / (2 + X[1] ** 2))), r"f\[1\] is not linear in x\[1\]"),
        (problem(U**2 - X[0] ** 2), "Q is not positive semi-definite: it has the eigenvalue -1"),
        (problem(ca.sumsqr(X)), "R is not positive definite: it has the eigenvalue 0"),
        (problem(terminal_cost=-(X[0] ** 2)), "P is not positive semi-definite"),
        (problem(X[0] ** 2 + U**2 + 4 * X[0] * U), r"\[Q S; S' R\] is not positive semi-definite"),
        (
            problem(constraints=(Constraint("disc", ca.sumsqr(X), upper=9),)),
            r"path constraint 'disc' is not linear in x\[0\]",
        ),
        (
            problem(constraints=(Constraint("start", X[0], 0, 0, at="initial"),)),
            "a linear solver takes no free start .'start'",
        ),
        (replace(problem(), model=replace(problem().model, dt=None)), "discretise"),
    ],
)
def test_what_is_not_linear_quadratic_is_named(ocp, message):
    with pytest.raises(UnsupportedProblem, match=message):
        linear_quadratic(ocp)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 4), st.integers(1, 3), st.integers(1, 6), st.integers(0, 99))
def test_arrays_have_their_shapes_and_give_the_cost_back(n, m, steps, seed):
    rng = np.random.default_rng(seed)
    plant = LinearPlant(name="any", A=rng.normal(size=(n, n)), B=rng.normal(size=(n, m)), dt=0.5)
    w = rng.normal(size=(steps + 1, n))
    ocp = tracking_ocp(
        plant, w, Q=2.0, R=3.0, P=5.0, x0=np.zeros(n), horizon=steps,
        control_bounds=Box(-1.0, np.inf), state_bounds=Box(-np.ones(n), np.full(n, np.inf)),
    )  # fmt: skip
    lq = linear_quadratic(ocp)
    data = lq.on(RunData.of(lq.ocp))
    assert data.matrices.A.shape == (steps, n, n)
    assert data.matrices.D_x.shape == (steps, n + m, n)
    assert data.matrices.D_u.shape == (steps, n + m, m)
    assert data.matrices.D_f.shape == (n, n)
    assert data.lower.shape == (steps, n + m)
    assert np.isinf(data.lower[0, :n]).all()
    x, u = rng.normal(size=n), rng.normal(size=m)
    mine = x @ data.matrices.Q[-1] @ x + u @ data.matrices.R[-1] @ u + 2 * data.q[-1] @ x
    p = ocp.parameter_values().at((steps - 1) / steps)[0]
    theirs = float(ocp.functions.running_cost(x, u, 0.0, p))
    assert mine + 2.0 * w[-2] @ w[-2] == pytest.approx(theirs, abs=1e-9)


def test_matrices_that_do_not_change_are_one_object():
    lq = linear_quadratic(problem())
    first, second = (lq.on(RunData.of(lq.ocp, [k, 0.0])) for k in range(2))
    assert first.matrices is second.matrices
    assert linear_quadratic(general()).fixed is None


# -- discretise ---------------------------------------------------------------------------


def continuous(**more) -> OCP:
    """Unstable, with drift, cross and linear terms and a held reference."""
    plant, w = mass_spring_damper(), ca.SX.sym("w")
    x, u = plant.model.x, plant.model.u
    cost = 3 * (x[0] - w) ** 2 + x[1] ** 2 + 0.5 * x[0] * u + u**2 + 0.2 * u + w
    model = replace(plant.model, f=plant.model.f + ca.vertcat(0.1, w))
    given = {
        "name": "continuous",
        "model": model,
        "x0": [1.0, -0.5],
        "horizon": 2.0,
        "running_cost": cost,
        "terminal_cost": 2 * x[0] ** 2,
        "parameters": (Signal("w", w, [0.0, 1.0, -1.0, 0.5, 0.5]),),
    }
    return OCP(**(given | more))


def test_discrete_problem_moves_and_costs_as_the_continuous_one():
    ocp, dt = continuous(), 0.25
    discrete = discretise(ocp, dt)
    f, x, u = ocp.functions, np.array([0.7, -1.2]), np.array([0.4])
    assert discrete.steps == 8
    for k in (0, 3, 7):
        p = discrete.parameter_values().at(k / 8)[0]
        flow = solve_ivp(
            lambda t, z, p=p: np.append(
                np.array(f.rate(z[:2], u, t, p)).ravel(), float(f.running_cost(z[:2], u, t, p))
            ),
            (0, dt), np.append(x, 0.0), rtol=1e-12, atol=1e-12, method="DOP853",
        ).y[:, -1]  # fmt: skip
        d = discrete.functions
        np.testing.assert_allclose(np.array(d.rate(x, u, 0, p)).ravel(), flow[:2], atol=1e-10)
        assert float(d.running_cost(x, u, 0, p)) == pytest.approx(flow[2], abs=1e-10)


def test_both_have_the_same_optimum():
    discrete = discretise(continuous(), 0.25)
    direct = MultipleShooting(intervals=8, integrator=RK4(steps=20))
    exact, integrated = solve(discrete, Riccati()), solve(continuous(), direct)
    np.testing.assert_allclose(exact.u, integrated.u, atol=1e-6)
    held = integrated.with_(u=exact.u, x=exact.x, costate=exact.costate)
    assert evaluate(held).cost == pytest.approx(evaluate(exact).cost, rel=1e-8)


@pytest.mark.parametrize(
    ("ocp", "dt", "error", "message"),
    [
        (continuous(), 0.3, ProblemError, "multiple"),
        (continuous(), -1.0, ProblemError, "positive"),
        (continuous(), 0.4, ProblemError, "samples"),
        (problem(), 0.1, ProblemError, "discrete already"),
    ],
)
def test_what_does_not_fit_the_step_is_refused(ocp, dt, error, message):
    with pytest.raises(error, match=message):
        discretise(ocp, dt)


def test_signals_between_samples_and_time_are_refused():
    ocp = continuous()
    linear = replace(ocp, parameters=(replace(ocp.parameters[0], hold="linear"),))
    with pytest.raises(UnsupportedProblem, match="signal 'w' is linear"):
        discretise(linear, 0.25)
    timed = replace(ocp, running_cost=ocp.running_cost + ocp.model.t * ocp.model.u)
    with pytest.raises(UnsupportedProblem, match="depends on the time"):
        discretise(timed, 0.25)
    gain = replace(ocp, running_cost=ocp.running_cost * (2 + ocp.parameters[0].symbol))
    with pytest.raises(UnsupportedProblem, match="Q depends on w"):
        discretise(gain, 0.25)
