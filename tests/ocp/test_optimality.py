"""The minimum principle: derivatives by differences, controls by brute force, ends by hand."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

from ocp import (
    OCP,
    Box,
    Constraint,
    FreeTime,
    MinimumPrinciple,
    Model,
    UnsupportedProblem,
    minimum_principle,
)
from ocp.minimum_principle.hamiltonian import hamiltonian
from tests.ocp.differences import gradient, jacobian
from tests.ocp.problems import energy, integrator, lag, pendulum
from tests.tolerances import DERIVATIVE, MINIMISER, ROUNDING

X, U, COSTATE = np.array([0.6, -0.4]), np.array([0.3, 0.9]), np.array([-1.2, 0.5])
T, P = 0.37, np.array([0.8, 0.5, -0.2])


# -- the Hamiltonian ------------------------------------------------------------------


def test_value_is_the_running_cost_and_the_costate_times_the_rate() -> None:
    ocp = pendulum()
    rate = np.array(ocp.functions.rate(X, U, T, P)).ravel()
    expected = float(ocp.functions.running_cost(X, U, T, P)) + COSTATE @ rate
    assert float(hamiltonian(ocp).value(X, U, COSTATE, T, P)) == pytest.approx(expected)


def test_derivatives() -> None:
    h = hamiltonian(pendulum())

    def row(f: ca.Function, *args: object) -> np.ndarray:
        return np.array(f(*args)).ravel()

    for got, expected in (
        (
            row(h.control_gradient, X, U, COSTATE, T, P),
            gradient(lambda u: float(h.value(X, u, COSTATE, T, P)), U),
        ),
        (
            row(h.costate_rate, X, U, COSTATE, T, P),
            -gradient(lambda x: float(h.value(x, U, COSTATE, T, P)), X),
        ),
        (
            row(h.time_slope, X, U, COSTATE, T, P),
            gradient(lambda t: float(h.value(X, U, COSTATE, t[0], P)), np.array([T])),
        ),
        (
            np.array(h.control_curvature(X, U, COSTATE, T, P)),
            jacobian(lambda u: row(h.control_gradient, X, u, COSTATE, T, P), U),
        ),
    ):
        np.testing.assert_allclose(got, expected, atol=DERIVATIVE)


def test_flow_is_canonical() -> None:
    ocp = pendulum()
    o = minimum_principle(ocp)
    u = np.array(o.control(X, COSTATE, T, P)).ravel()
    got = np.array(o.flow(np.append(X, COSTATE), T, P)).ravel()
    h_costate = gradient(lambda c: float(o.hamiltonian.value(X, u, c, T, P)), COSTATE)
    h_x = gradient(lambda x: float(o.hamiltonian.value(x, u, COSTATE, T, P)), X)
    np.testing.assert_allclose(got, np.append(h_costate, -h_x), atol=DERIVATIVE)


# -- the minimising control -----------------------------------------------------------


def two_controls(cost, bounds: Box | None = None) -> OCP:
    """dx/dt = u + cross terms, with a running cost that is a function of (x, u)."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 2)
    f = ca.vertcat(u[0] + 0.3 * u[1] * x[0], u[1] - x[0])
    model = Model(name="two", x=x, u=u, f=f)
    return OCP(
        name="two",
        model=model,
        x0=[0.1, 0.2],
        horizon=1.0,
        running_cost=cost(x, u),
        control_bounds=bounds or Box(),
    )


def diagonal(x, u):
    return (1 + x[0] ** 2) * u[0] ** 2 + 0.5 * u[1] ** 2 + u[0] * x[1]


def full(x, u):
    return u[0] ** 2 + u[1] ** 2 + 1.2 * u[0] * u[1] + ca.sumsqr(x)


def quartic(x, u):
    return ca.sumsqr(u**2) + ca.sumsqr(u) + x[0] * u[0]


def coupled_quartic(x, u):
    return ca.sumsqr(u) + (u[0] + u[1]) ** 4 + x[1] * u[1]


CASES = {
    "diagonal": (diagonal, Box(), "closed"),
    "full": (full, Box(), "closed"),
    "saturated": (diagonal, Box([-0.5, -np.inf], [0.4, 1.0]), "closed"),
    "full, bounded": (full, Box(-0.6, [0.5, 0.8]), "implicit"),
    "quartic": (quartic, Box(), "implicit"),
    "quartic, bounded": (quartic, Box(-0.5, 0.3), "implicit"),
    "quartic, away from 0": (quartic, Box([0.2, -np.inf], [0.9, -0.1]), "implicit"),
    "coupled quartic": (coupled_quartic, Box(), "implicit"),
    "coupled quartic, bounded": (coupled_quartic, Box(-0.4, [0.2, 0.5]), "implicit"),
}


@pytest.mark.many
@pytest.mark.parametrize("name", CASES)
def test_control_minimises_the_hamiltonian(name: str) -> None:
    cost, box, form = CASES[name]
    ocp = two_controls(cost, box)
    o = minimum_principle(ocp)
    assert o.control.is_a("SXFunction") is (form == "closed")
    rng = np.random.default_rng(1)
    for _ in range(20):
        x, costate = rng.normal(size=2), 2.0 * rng.normal(size=2)
        u = np.array(o.control(x, costate, 0.0, [])).ravel()
        np.testing.assert_allclose(u, brute_force(ocp, o, x, costate), atol=MINIMISER)
        assert not ocp.control_bounds.excess(u).any()


def brute_force(ocp: OCP, o: MinimumPrinciple, x: np.ndarray, costate: np.ndarray) -> np.ndarray:
    """Minimise H within the bounds by a general optimiser (H is convex in these cases)."""
    box = ocp.control_bounds
    found = minimize(
        lambda u: float(o.hamiltonian.value(x, u, costate, 0.0, [])),
        box.clip(np.zeros(2)),
        jac=lambda u: np.array(o.hamiltonian.control_gradient(x, u, costate, 0.0, [])).ravel(),
        method="L-BFGS-B",
        bounds=list(zip(np.asarray(box.lower), np.asarray(box.upper), strict=True)),
        options={"ftol": 0.0, "gtol": 1e-11, "maxiter": 500},
    )
    return found.x


def test_an_implicit_law_has_the_derivative_of_the_implicit_function() -> None:
    o = minimum_principle(two_controls(quartic))
    x, costate = np.array([0.3, -0.7]), np.array([1.1, -0.4])
    inputs = [ca.MX.sym("x", 2), ca.MX.sym("costate", 2)]
    u = o.control(*inputs, 0.0, ca.DM(0, 1))
    slope = ca.Function("slope", inputs, [ca.jacobian(u, inputs[1])])
    expected = jacobian(lambda c: np.array(o.control(x, c, 0.0, [])), costate)
    np.testing.assert_allclose(np.array(slope(x, costate)), expected, atol=DERIVATIVE)


# -- what is refused ------------------------------------------------------------------


def test_refuses_a_control_that_enters_linearly_and_names_it() -> None:
    with pytest.raises(UnsupportedProblem, match=r"linear in the control u_1: .*bang-bang"):
        minimum_principle(two_controls(lambda x, u: u[0] ** 2 + u[1]))


def test_refuses_a_hamiltonian_that_does_not_determine_the_control() -> None:
    with pytest.raises(UnsupportedProblem, match="H_uu is singular"):
        minimum_principle(two_controls(lambda x, u: (u[0] + u[1]) ** 2))


def test_refuses_discrete_time() -> None:
    with pytest.raises(UnsupportedProblem, match=r"lag: .* continuous time"):
        minimum_principle(lag())


def test_refuses_signals_that_stretch_with_the_final_time() -> None:
    with pytest.raises(UnsupportedProblem, match="signal 'held' stretches with the free final"):
        minimum_principle(pendulum(horizon=FreeTime(guess=1.0)))


@pytest.mark.parametrize("at", ["terminal", "initial"])
def test_refuses_inequalities_at_the_ends(at) -> None:
    base = integrator()
    ocp = OCP(
        name="reach",
        model=base.model,
        x0=0.0,
        horizon=1.0,
        running_cost=base.running_cost,
        constraints=(Constraint("far", base.model.x, 1.0, 2.0, at=at),),
    )
    with pytest.raises(UnsupportedProblem, match=f"the {at} constraint 'far' is an inequality"):
        minimum_principle(ocp)


# -- the ends -------------------------------------------------------------------------


def test_energy_optimum_meets_all_conditions() -> None:
    """Closed form in problems.energy: u = 6 - 12 t, costates (-12, 12 t - 6)."""
    o = minimum_principle(energy())
    for t in (0.0, 0.3, 1.0):
        x = np.array([3 * t**2 - 2 * t**3, 6 * t - 6 * t**2])
        costate = np.array([-12.0, 12 * t - 6])
        u = float(o.control(x, costate, t, []))
        assert u == pytest.approx(6 - 12 * t)
        flow = np.array(o.flow(np.append(x, costate), t, [])).ravel()
        np.testing.assert_allclose(flow, [x[1], u, 0.0, 12.0], atol=ROUNDING)
    residual = o.end([1.0, 0.0], [-12.0, 6.0], [-12.0, 6.0], 1.0, [])
    np.testing.assert_allclose(np.array(residual).ravel(), 0.0, atol=ROUNDING)
    off = np.array(o.end([1.1, 0.0], [-12.0, 6.0], [-12.0, 5.0], 1.0, [])).ravel()
    np.testing.assert_allclose(off, [0.0, 1.0, 0.1, 0.0], atol=ROUNDING)
    assert o.start.size1_in(2) == 0


def test_a_free_end_has_the_gradient_of_the_terminal_cost() -> None:
    ocp = pendulum()
    phi_x = gradient(lambda x: float(ocp.functions.terminal_cost(x, T, P)), X)
    residual = np.array(minimum_principle(ocp).end(X, phi_x, [], T, P)).ravel()
    np.testing.assert_allclose(residual, 0.0, atol=DERIVATIVE)


def test_a_costate_is_normal_to_the_manifold_of_the_start() -> None:
    base = pendulum()
    circle = Constraint("circle", ca.sumsqr(base.model.x), 1.0, 1.0, at="initial")
    o = minimum_principle(
        OCP(
            name="circle",
            model=base.model,
            x0=[1.0, 0.0],
            horizon=1.0,
            running_cost=base.running_cost,
            parameters=base.parameters,
            constraints=(circle,),
        )
    )
    x, mu = np.array([0.6, 0.8]), np.array([-0.7])
    normal = np.array(o.start(x, -2 * mu * x, mu, 0.0, P, x)).ravel()
    np.testing.assert_allclose(normal, 0.0, atol=ROUNDING)
    tangent = np.array([-x[1], x[0]])
    tilted = np.array(o.start(x, -2 * mu * x + tangent, mu, 0.0, P, x)).ravel()
    np.testing.assert_allclose(tilted, [0.0, *tangent], atol=ROUNDING)


def test_free_time_without_explicit_time() -> None:
    """min int 1 + u^2/2, x: 0 -> 1. H = 1 - l^2/2 = 0, so l = -sqrt(2), T = 1/sqrt(2)."""
    ocp = reach(running=1.0, terminal=0.0)
    lam = -np.sqrt(2.0)
    residual = np.array(
        minimum_principle(ocp).end([1.0], [lam], [lam], 1 / np.sqrt(2.0), [])
    ).ravel()
    np.testing.assert_allclose(residual, 0.0, atol=ROUNDING)


def test_free_time_with_a_cost_of_time() -> None:
    """min T^2/2 + int u^2/2, x: 0 -> 1. T = l^2/2 and u = 1/T = -l give T = 2^(-1/3)."""
    ocp = reach(running=0.0, terminal="T")
    duration = 2.0 ** (-1.0 / 3.0)
    lam = -1.0 / duration
    residual = np.array(minimum_principle(ocp).end([1.0], [lam], [lam], duration, [])).ravel()
    np.testing.assert_allclose(residual, 0.0, atol=ROUNDING)


def reach(*, running: float, terminal: object) -> OCP:
    base = integrator()
    m = base.model
    return OCP(
        name="reach",
        model=m,
        x0=0.0,
        horizon=FreeTime(guess=1.0, lower=0.1, upper=5.0),
        running_cost=running + m.u**2 / 2,
        terminal_cost=m.t**2 / 2 if terminal == "T" else 0.0,
        constraints=(Constraint("end", m.x, 1.0, 1.0, at="terminal"),),
    )
