"""The cart-pole: its dynamics from the Lagrangian, what it keeps, and the cost of the swing-up."""

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from models import CartPole, cart_pole_swing_up, cart_pole_upright
from ocp import OCP, ProblemError, evaluate, solve
from solvers import IndirectShooting, MultipleShooting
from tests.ocp.differences import jacobian
from tests.tolerances import DERIVATIVE, ROUNDING

SYSTEM = CartPole(cart=1.3, pole=0.4, length=0.7, gravity=9.7)
# Optimum of the swing-up, certified by `polish` to 1e-10 (second order included).
# The local optimum that the straight guess leads to.
REFERENCE = 58.807667458


def lagrangian_acceleration(system: CartPole) -> ca.Function:
    """Return (q, q', u) -> q'' from d/dt L_q' - L_q = (u, 0), L from the mass's position alone."""
    q, v, u = ca.SX.sym("q", 2), ca.SX.sym("v", 2), ca.SX.sym("u")
    mass = ca.vertcat(q[0] + system.length * ca.sin(q[1]), -system.length * ca.cos(q[1]))
    kinetic = (system.cart * v[0] ** 2 + system.pole * ca.sumsqr(ca.jtimes(mass, q, v))) / 2
    lagrangian = kinetic - system.pole * system.gravity * mass[1]
    momentum = ca.gradient(lagrangian, v)
    inertia = ca.jacobian(momentum, v)
    rest = ca.gradient(lagrangian, q) - ca.jtimes(momentum, q, v) + ca.vertcat(u, 0)
    return ca.Function("a", [q, v, u], [ca.solve(inertia, rest)])


MODEL = SYSTEM.model()
RATE = ca.Function("rate", [MODEL.x, MODEL.u], [MODEL.f])
ACCELERATION = lagrangian_acceleration(SYSTEM)
ENERGY = ca.Function("energy", [MODEL.x], [SYSTEM.energy(MODEL.x)])
state = st.tuples(*[st.floats(-10.0, 10.0)] * 4)


@given(x=state, u=st.floats(-50.0, 50.0))
def test_dynamics_are_those_of_the_lagrangian(x: tuple[float, ...], u: float) -> None:
    rate = np.array(RATE(x, u)).ravel()
    np.testing.assert_array_equal(rate[:2], x[2:])
    expected = np.array(ACCELERATION(x[:2], x[2:], u)).ravel()
    np.testing.assert_allclose(rate[2:], expected, rtol=ROUNDING, atol=1e3 * ROUNDING)


def test_energy_is_kept_without_force() -> None:
    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return np.array(RATE(x, 0.0)).ravel()

    run = solve_ivp(rate, (0.0, 5.0), [0.2, 2.5, -0.4, 1.0], rtol=1e-11, atol=1e-11)
    energies = np.array(ENERGY(run.y)).ravel()
    assert np.ptp(run.y[1]) > 1.0
    np.testing.assert_allclose(energies, energies[0], rtol=1e-8)


@given(x=state, u=st.floats(-50.0, 50.0))
def test_a_force_works_at_the_rate_of_its_power(x: tuple[float, ...], u: float) -> None:
    slope = ca.jacobian(SYSTEM.energy(MODEL.x), MODEL.x) @ MODEL.f
    power = float(ca.Function("power", [MODEL.x, MODEL.u], [slope])(x, u))
    assert power == pytest.approx(u * x[2], rel=1e-9, abs=1e-9)


def test_derivatives_are_those_of_finite_differences() -> None:
    x, u = np.array([0.3, 2.0, -0.5, 1.5]), 4.0
    exact = ca.Function("a", [MODEL.x, MODEL.u], [ca.jacobian(MODEL.f, MODEL.x)])(x, u)
    numeric = jacobian(lambda y: np.array(RATE(y, u)).ravel(), x)
    np.testing.assert_allclose(np.array(exact), numeric, atol=10 * DERIVATIVE)


@pytest.mark.parametrize("angle", [0.0, np.pi])
def test_it_rests_hanging_and_standing(angle: float) -> None:
    np.testing.assert_allclose(np.array(RATE([1.0, angle, 0.0, 0.0], 0.0)), 0.0, atol=1e-14)


def direct(intervals: int) -> float:
    return evaluate(solve(cart_pole_swing_up(), MultipleShooting(intervals)).or_raise()).cost


def test_held_forces_extrapolate_to_the_optimum() -> None:
    """They cost O(h^2) more than the best ones: Richardson's limit is the optimum."""
    coarse, fine = direct(100), direct(200)
    assert coarse > fine > REFERENCE
    assert fine + (fine - coarse) / 3 == pytest.approx(REFERENCE, rel=1e-6)


def test_the_direct_answer_is_an_extremal() -> None:
    """No bound is active, so that the problem without the track has the same optimum."""
    start = solve(cart_pole_swing_up(), MultipleShooting(100)).or_raise()
    assert np.abs(start.u).max() < 15.0
    assert np.abs(start.x[:, 0]).max() < 1.5
    free = cart_pole_swing_up(track=np.inf)
    extremal = solve(free, IndirectShooting(segments=15, steps=450), guess=start).or_raise()
    assert extremal.cost == pytest.approx(REFERENCE, rel=1e-6)
    shown = np.abs(start.costate[0] - extremal.costate[0]).max()
    assert shown < 1e-2 * np.abs(extremal.costate[0]).max()


def test_a_bound_that_is_active_costs() -> None:
    solver = MultipleShooting(50)
    free = solve(cart_pole_swing_up(), solver).or_raise()
    weak = solve(cart_pole_swing_up(force=12.0), solver).or_raise()
    near = solve(cart_pole_swing_up(track=1.05), solver).or_raise()
    assert min(weak.cost, near.cost) > 1.001 * free.cost
    assert np.abs(weak.u).max() == pytest.approx(12.0, abs=1e-6)
    assert np.abs(near.x[:, 0]).max() == pytest.approx(1.05, abs=1e-6)


def test_the_cushion_takes_the_place_of_the_bound() -> None:
    hard, soft = cart_pole_upright(track=0.6), cart_pole_upright(track=0.6, cushion=0.1)
    assert hard.state_bounds.is_active
    assert not soft.state_bounds.is_active
    assert (hard.smoothness, soft.smoothness) == (2, 1)
    costs = [
        [float(ocp.functions.running_cost([p, np.pi, 0, 0], 0.0, 0.0, [])) for p in (0.5, 0.55)]
        for ocp in (hard, soft)
    ]
    assert costs[0] == pytest.approx([0.125, 0.15125])
    assert costs[1] == pytest.approx([0.125, 0.15125 + 0.5 * 1e5 * 0.05**2])


def test_standing_in_the_middle_costs_nothing() -> None:
    ocp = cart_pole_upright(distance=0.3)
    goal = [0.3, np.pi, 0.0, 0.0]
    assert float(ocp.functions.running_cost(goal, 0.0, 0.0, [])) == 0.0
    assert float(ocp.functions.terminal_cost(goal, 0.0, [])) == 0.0


@pytest.mark.parametrize("build", [cart_pole_swing_up, cart_pole_upright])
def test_both_describe_themselves(build: Callable[[], OCP]) -> None:
    assert "angular_velocity" in build().describe()


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: CartPole(cart=0.0), "cart = 0.0"),
        (lambda: CartPole(pole=-1.0), "pole = -1.0"),
        (lambda: CartPole(length=np.nan), "length"),
        (lambda: CartPole(gravity=-9.81), "gravity"),
        (lambda: cart_pole_swing_up(force=-1.0), "force = -1.0"),
        (lambda: cart_pole_swing_up(force=np.nan), "force"),
        (lambda: cart_pole_swing_up(track=0.5), "beyond the track"),
        (lambda: cart_pole_swing_up(distance=np.inf), "distance"),
        (lambda: cart_pole_swing_up(horizon=0.0), "horizon"),
        (lambda: cart_pole_upright(cushion=-0.1), "cushion"),
        (lambda: cart_pole_upright(track=0.5, cushion=0.6), "cushion"),
        (lambda: cart_pole_upright(track=np.inf, cushion=0.5), "cushion"),
        (lambda: cart_pole_upright(stage=[1.0, 1.0]), "stage has 2 entries"),
        (lambda: cart_pole_upright(end=[1.0, 1.0, -1.0, 1.0]), "end = "),
        (lambda: cart_pole_upright(effort=0.0), "effort = 0.0"),
    ],
)
def test_bad_numbers_are_named(build: Callable[[], object], message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        build()


def test_no_gravity_is_a_table() -> None:
    assert CartPole(gravity=0.0).model().nx == 4
