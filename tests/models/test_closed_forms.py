"""Closed forms: the control of the docstring, driven through the model, ends and costs so."""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve, minimize

from benchmarks.cases import LIBRARY
from models import mass_spring_damper, stable_plant, unstable_plant
from models.textbook import two_link_arm_energy
from tests.models.test_closed_forms_in_practice import ROOTS as IN_PRACTICE
from tests.tolerances import CERTIFIED, DERIVATIVE, ROUNDING, STEP

CASES = {case.name: case for case in LIBRARY}
E = np.e
W = np.sqrt(0.15)
PUSH = (1.0 - 1.0 / np.sqrt(5.0)) / 2.0
END = np.arctanh(1.0 / np.sqrt(3.0))
LATE = np.log(E - 1.0)
S = np.sqrt(2.0)
PEAK = np.sqrt(np.tanh(4.0))
K = 500.0 / np.sqrt(5000.0)
SWITCH = K * np.arctanh(PEAK)
ARC = (np.pi - np.arccos(1.0 / 7.0)) / 2.0


def turn_round(t: float, wall: float) -> float:
    return -2.0 / (3.0 * wall) * max(0.0, 1.0 - min(t, 1.0 - t) / (3.0 * wall))


def hyper(t: float) -> float:
    """u = x + dx/dt along x = 1.5 exp(-S t) + exp(-S (40 - t))."""
    return 1.5 * (1.0 - S) * np.exp(-S * t) + (1.0 + S) * np.exp(-S * (40.0 - t))


# case: the control, the final time, where the control is not smooth.
CONTROLS: dict[str, tuple[Callable, float, Sequence[float]]] = {
    "double-integrator-energy": (lambda t: 6.0 - 12.0 * t, 1.0, ()),
    "double-integrator-minimum-time": (lambda t: 1.0 if t < 1.0 else -1.0, 2.0, (1.0,)),
    "double-integrator-bounded-energy": (
        lambda t: np.clip(5.0 * (0.5 - t) / W, -5.0, 5.0), 1.0, (0.5 - W, 0.5 + W),
    ),
    "double-integrator-fuel": (
        lambda t: [5.0 * (t < PUSH), 5.0 * (t > 1.0 - PUSH)], 1.0, (PUSH, 1.0 - PUSH),
    ),
    "double-integrator-distance": (lambda t: (1.0 - t) / 2.0, 1.0, ()),
    "bryson-denham": (lambda t: turn_round(t, 1.0 / 9.0), 1.0, (1.0 / 3.0, 2.0 / 3.0)),
    "breakwell": (lambda t: turn_round(t, 0.1), 1.0, (0.3, 0.7)),
    "beam": (lambda t: turn_round(t, 0.1), 1.0, (0.3, 0.7)),
    "integrator-free-time": (lambda t: 2.0, 10.0, ()),
    "integrator-free-time-quadratic": (lambda t: np.cosh(t) / np.sinh(END), END, ()),
    "turnpike": (lambda t: -1.0 if t < 1.0 else float(t > 1.5), 2.0, (1.0, 1.5)),
    "mixed-constraint": (lambda t: np.exp(-t), 1.0, ()),
    "moving-floor": (lambda t: 2.0 * (2.0 - t) * (1.0 < t < 2.0), 3.0, (1.0, 2.0)),
    "exponential-energy": (lambda t: 2.0 / (E**2 - 1.0) * np.exp(t), 1.0, ()),
    "exponential-fuel": (lambda t: float(t > LATE), 1.0, (LATE,)),
    "exponential-minimum-time": (lambda t: 1.0, np.log(2.0), ()),
    "linear-hypersensitive": (hyper, 40.0, (10.0, 30.0)),
    "integrator-priced-end": (lambda t: -7.5 / 51.0, 10.0, ()),
    "car-minimum-time": (
        lambda t: 2500.0 if t < SWITCH else -2500.0, SWITCH + K * np.arctan(PEAK), (SWITCH,),
    ),
    "shortest-turn": (lambda t: 2.0 * (t < ARC), np.sqrt(12.0) + ARC, (ARC,)),
    "dido": (lambda t: (0.5 - t) / np.sqrt(1.0 / 3.0 - (t - 0.5) ** 2), 1.0, ()),
}  # fmt: skip


@pytest.mark.parametrize("name", CONTROLS)
def test_the_optimal_control_ends_and_costs_as_derived(name: str) -> None:
    control, end, corners = CONTROLS[name]
    ocp, reference = CASES[name].build(), CASES[name].reference
    functions, nx = ocp.functions, ocp.model.nx

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        u = control(t)
        f = np.array(functions.rate(z[:nx], u, t, [])).ravel()
        return np.append(f, float(functions.running_cost(z[:nx], u, t, [])))

    z = np.append(ocp.start(), 0.0)
    inside = 1e-12  # a control that jumps is asked on its own side
    for left, right in zip((0.0, *corners), (*corners, end), strict=True):
        span = (left + inside, right - inside)
        z = solve_ivp(rate, span, z, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    cost = z[-1] + float(functions.terminal_cost(z[:nx], end, []))
    assert reference is not None
    assert cost == pytest.approx(reference.value, rel=CERTIFIED)
    for c in ocp.at("terminal"):
        value = ca.Function("c", [ocp.model.x, ocp.model.t], [c.expression])(z[:nx], end)
        np.testing.assert_allclose(np.array(value).ravel(), np.asarray(c.lower), atol=CERTIFIED)


# -- closed forms up to a root ----------------------------------------------------------------


def root_of(function: Callable[[float], float], low: float, high: float) -> float:
    root: Any = brentq(function, low, high, xtol=1e-15)
    return float(root)


def roots_of(function: Callable, near: list[float]) -> np.ndarray:
    roots: Any = fsolve(function, near, xtol=1e-13)
    return roots


def brachistochrone() -> float:
    phi = root_of(lambda p: p - np.sin(p) - 1.0 + np.cos(p), 1.0, 4.0)
    return phi * np.sqrt(2.0 / (1.0 - np.cos(phi)) / 9.8)


def tangent_steering() -> float:
    def ends(z: np.ndarray) -> list[float]:
        tau, duration = z
        sigma = np.arcsinh(tau)
        height = duration**2 / (4.0 * tau**2) * (tau * np.sqrt(1.0 + tau**2) - sigma)
        return [100.0 * duration * sigma / tau - 45.0, 100.0 * height - 5.0]

    return float(roots_of(ends, [1.4, 0.55])[1])


def chain() -> float:
    c = root_of(lambda c: 2.0 * c * np.sinh(0.5 / c) - np.sqrt(12.0), 0.1, 2.0)
    b = 0.5 - c * np.arctanh(0.5)
    mu = c * np.cosh(b / c) - 1.0
    return quad(lambda t: (c * np.cosh((t - b) / c) - mu) * np.cosh((t - b) / c), 0.0, 1.0,
                epsabs=1e-13)[0]  # fmt: skip


def zermelo() -> float:
    def secant(tau: float) -> float:
        return np.sqrt(1.0 + tau**2)

    def ends(tau: np.ndarray) -> list[float]:
        first, last = [(t * secant(t) - np.arcsinh(t)) / 2.0 - secant(tau[1]) * t for t in tau]
        return [secant(tau[0]) - secant(tau[1]) - 1.86, last - first + 3.66]

    first, last = roots_of(ends, [-3.7, 1.7])
    return last - first


def fuller() -> float:
    c = np.sqrt((np.sqrt(33.0) - 1.0) / 24.0)
    v = 1.0 / np.sqrt(1.0 + 2.0 * c)
    q = np.sqrt((1.0 - 2.0 * c) / (1.0 + 2.0 * c))
    first = quad(lambda t: (t - t**2 / 2.0) ** 2, 0.0, 1.0 + v)[0]
    arc = quad(lambda t: (c * v**2 - v * t + t**2 / 2.0) ** 2, 0.0, v * (1.0 + q))[0]
    return first + arc / (1.0 - q**5)


def fuller_switching_curve() -> float:
    """The best of all self-similar switching laws, without the formula of its constant."""

    def cost(c: float) -> float:
        v, q = 1.0 / np.sqrt(1.0 + 2.0 * c), np.sqrt((1.0 - 2.0 * c) / (1.0 + 2.0 * c))
        first = quad(lambda t: (t - t**2 / 2.0) ** 2, 0.0, 1.0 + v, epsabs=1e-13)[0]
        arc = quad(lambda t: (c * v**2 - v * t + t**2 / 2.0) ** 2, 0.0, v * (1.0 + q))[0]
        return first + arc / (1.0 - q**5)

    return min(cost(c) for c in np.linspace(0.4436, 0.4456, 201))


def hamiltonian_matrix(a, b, q, r, end, p, start) -> float:
    """x0'P x0 of the cost x'Qx + u'Ru, with the final weight p."""
    n = len(a)
    flow = expm(end * np.block([[a, -b @ b.T / r], [-q, -a.T]]))
    riccati = np.linalg.solve(flow[n:, n:] - p @ flow[:n, n:], p @ flow[:n, :n] - flow[n:, :n])
    return float(start @ riccati @ start)


def oscillator() -> float:
    a, b = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([[0.0], [1.0]])
    return hamiltonian_matrix(a, b, np.eye(2) / 2, 0.5, 5.0, np.zeros((2, 2)), np.array([0.0, 1.0]))


def mass() -> float:
    plant = mass_spring_damper()
    q, start = np.diag([100.0, 10.0]), np.array([1.0, 0.0])
    return hamiltonian_matrix(plant.A, plant.B, q, 0.5, 4.0, 100.0 * np.eye(2), start)


def recursion(a, b, q, r, p, steps, start) -> float:
    for _ in range(steps):
        gain = np.linalg.solve(r * np.eye(1) + b.T @ p @ b, b.T @ p @ a)
        p = q + a.T @ p @ (a - b @ gain)
    return float(start @ p @ start)


def plant_cost(plant) -> float:
    return recursion(plant.A, plant.B, 100 * np.eye(3), 500.0, 10 * np.eye(3), 50, np.ones(3))


def sampled_mass() -> float:
    a, b = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([[0.005], [0.1]])
    return recursion(a, b, np.eye(2), 1.0, np.eye(2), 20, np.array([1.0, 0.0]))


def tube(end: float) -> float:
    """What is left of the first two substances, less 1: u = 1, constant, 0."""

    def rate(u: float) -> np.ndarray:
        return np.array([[-u, 10.0 * u], [u, -10.0 * u - (1.0 - u)]])

    def left(z: np.ndarray) -> float:
        first, u, last = z
        flow = expm((end - last) * rate(0.0)) @ expm((last - first) * rate(u))
        return float((flow @ expm(first * rate(1.0)))[:, 0].sum() - 1.0)

    options = {"xatol": 1e-10, "fatol": 1e-16, "maxiter": 2000}
    return float(minimize(left, [0.13, 0.22, end - 0.27], method="Nelder-Mead",
                          options=options).fun)  # fmt: skip


def meeting() -> float:
    """Turn about (0, 2), then straight on to where the target is."""

    def miss(z: np.ndarray) -> list[float]:
        end, turn = z
        straight = 2.0 * (end - turn)
        east = -2.0 * np.sin(turn) - straight * np.cos(turn)
        return [east - 3.0 - end, 2.0 * (1.0 - np.cos(turn)) + straight * np.sin(turn) - 2.0]

    return float(roots_of(miss, [9.0, 3.2])[0])


def landing() -> float:
    alpha, c = 1.227 / 2.349, 2.349

    def ends(z: np.ndarray) -> list[float]:
        fall, brake = z
        left = 1.0 - alpha * brake
        speed = -0.783 - fall
        height = 1.0 - 0.783 * fall - fall**2 / 2.0 + speed * brake - brake**2 / 2.0
        height += c * (brake + left * np.log(left) / alpha)
        return [speed - brake - c * np.log(left), height]

    return alpha * float(roots_of(ends, [0.3, 1.1])[1]) - 1.0


def crane() -> float:
    """The Gramian of position, speed, angle, its rate and the acceleration, by one exponential."""
    a, b = np.zeros((5, 5)), np.zeros((5, 1))
    a[0, 1] = a[1, 4] = a[2, 3] = 1.0
    a[3, 2], a[3, 4], b[4] = -9.81 / 10.0, -1.0 / 10.0, 1.0
    flow = expm(9.0 * np.block([[-a, b @ b.T], [np.zeros((5, 5)), a.T]]))
    gramian = (flow[5:, 5:].T @ flow[:5, 5:])[:4, :4]
    far = np.array([10.0, 0.0, 0.0, 0.0])
    return float(far @ np.linalg.solve(gramian, far))


ROOTS: dict[str, Callable[[], float]] = {
    "interceptor": meeting,
    "moon-landing": landing,
    "overhead-crane": crane,
    "catalyst-mixing": lambda: tube(1.0),
    "two-catalysts": lambda: tube(4.0),
    "brachistochrone": brachistochrone,
    "linear-tangent-steering": tangent_steering,
    "hanging-chain": chain,
    "zermelo": zermelo,
    "fuller": fuller,
    "oscillator-regulator": oscillator,
    "mass-on-a-spring": mass,
    "stable-plant": lambda: plant_cost(stable_plant()),
    "unstable-plant": lambda: plant_cost(unstable_plant()),
    "discrete-double-integrator": sampled_mass,
}


@pytest.mark.parametrize("name", ROOTS)
def test_a_root_gives_the_printed_digits(name: str) -> None:
    reference = CASES[name].reference
    assert reference is not None
    assert ROOTS[name]() == pytest.approx(reference.value, rel=2 * ROUNDING, abs=reference.error)


def test_fullers_constant_is_the_best_one() -> None:
    assert fuller_switching_curve() == pytest.approx(fuller(), rel=DERIVATIVE)
    assert fuller_switching_curve() >= fuller() * (1.0 - ROUNDING)


def test_every_closed_form_is_derived_here() -> None:
    closed = {c.name for c in LIBRARY if c.reference and c.reference.is_closed_form}
    assert closed == set(CONTROLS) | set(ROOTS) | set(IN_PRACTICE)


@pytest.mark.parametrize("seed", range(5))
def test_the_torques_of_the_two_link_arm_are_its_power(seed: int) -> None:
    """The kinetic energy changes by torque times rate: nothing is gained by the joints."""
    model = two_link_arm_energy().model
    f = ca.Function("f", [model.x, model.u], [model.f])

    def energy(x: np.ndarray) -> float:
        a, cosine = 0.25, np.cos(x[1])
        far = a / 3.0
        mass = [[5.0 / 3.0 * a + a * cosine, far + a / 2.0 * cosine], [0.0, far]]
        mass[1][0] = mass[0][1]
        return float(x[2:] @ np.array(mass) @ x[2:] / 2.0)

    rng = np.random.default_rng(seed)
    x, u = rng.normal(size=4), rng.normal(size=2)
    rate = np.array(f(x, u)).ravel()
    gain = (energy(x + STEP * rate) - energy(x - STEP * rate)) / (2 * STEP)
    assert gain == pytest.approx(u @ x[2:], abs=100 * DERIVATIVE)
