"""The referee's cost is within its own error bar: stiff, unstable, short, long, many nodes.

The truth is a closed form, written beside each problem, or scipy's Radau at 1e-11.
"""

from collections.abc import Callable
from itertools import pairwise
from math import erf, exp, expm1, pi, sin, sqrt

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ocp import OCP, Evaluation, Model, Solution, evaluate
from tests.ocp.problems import trajectory

X, U, T = (ca.SX.sym(name) for name in "xut")
# Errors below this, relative to the cost, are rounding.
FLOOR = 1e-13
# The bar is at most this many times the true error, in nine of ten cases.
WIDE = 100.0


def problem(f: ca.SX, running_cost: ca.SX, *, x0: float = 0.0, horizon: float = 1.0) -> OCP:
    model = Model(name="one state", x=X, u=U, t=T, f=f)
    return OCP(name="truth", model=model, x0=[x0], horizon=horizon, running_cost=running_cost)


def settled(rate: float, x0: float, u: np.ndarray, h: float) -> tuple[float, np.ndarray]:
    """Return the integral of x^2 for dx/dt = -rate x + u, u held, and x at the nodes.

    In an interval x = e + a exp(-rate s), e = u / rate, a = x - e.
    """
    cost, x, nodes = 0.0, x0, [x0]
    for v in u:
        e = v / rate
        a = x - e
        once, twice = -expm1(-rate * h) / rate, -expm1(-2.0 * rate * h) / (2.0 * rate)
        cost += e * e * h + 2.0 * e * a * once + a * a * twice
        x = e + a * exp(-rate * h)
        nodes.append(x)
    return cost, np.array(nodes)[:, None]


def stiff(rng: np.random.Generator) -> tuple[Solution, float]:
    """rate T from 1e2 to 1e7."""
    rate, n = 10 ** rng.uniform(2, 7), int(rng.integers(3, 80))
    x0, u = rng.normal(), rate * rng.normal(size=n)
    cost, nodes = settled(rate, x0, u, 1.0 / n)
    return trajectory(problem(-rate * X + U, X**2, x0=x0), u[:, None], x=nodes), cost


def unstable(rng: np.random.Generator) -> tuple[Solution, float]:
    """e^(rate T) up to 1e15, held near zero by the controls of a feedback."""
    rate, n = rng.uniform(3.0, 34.5), int(rng.integers(20, 200))
    h = 1.0 / n
    gain = (exp(rate * h) - exp(-rate * h * rng.uniform(0.3, 2.0))) * rate / expm1(rate * h)
    x, u = 1.0, []
    for _ in range(n):
        u.append(-gain * x)
        x = x * exp(rate * h) + u[-1] * expm1(rate * h) / rate
    controls = np.array(u)
    cost, nodes = settled(-rate, 1.0, controls, h)
    ocp = problem(rate * X + U, X**2 + U**2, x0=1.0)
    return trajectory(ocp, controls[:, None], x=nodes), cost + h * float(controls @ controls)


def spike(rng: np.random.Generator) -> tuple[Solution, float]:
    """dx/dt = a exp(-((t - c)/w)^2)/w, cost the integral of x, by parts an integral of erf."""
    w, c, a, n = 10 ** rng.uniform(-2.5, -1), rng.uniform(0.1, 0.9), rng.normal(), 20
    f = a * ca.exp(-(((T - c) / w) ** 2)) / w + U

    def primitive(z: float) -> float:
        return z * erf(z) + exp(-z * z) / sqrt(pi)

    area = w * (primitive((1 - c) / w) - primitive(-c / w)) - erf(-c / w)
    return trajectory(problem(f, X), np.zeros((n, 1))), a * sqrt(pi) / 2 * area


def jump(rng: np.random.Generator) -> tuple[Solution, float]:
    """dx/dt = 1 before c and -2 after it, between two nodes: c^2/2 + c (1 - c) - (1 - c)^2."""
    c, n = rng.uniform(0.1, 0.9), int(rng.integers(3, 60))
    f = ca.if_else(c > T, 1.0, -2.0) + U
    cost = c * c / 2 + c * (1 - c) - (1 - c) ** 2
    return trajectory(problem(f, X), np.zeros((n, 1))), cost


def many_nodes(rng: np.random.Generator) -> tuple[Solution, float]:
    """x = cos(w t), w up to 0.5 per interval: 1/2 + sin(2 w)/(4 w)."""
    n = int(rng.choice([500, 2000, 5000]))
    w, v = n * rng.uniform(0.1, 0.5), ca.SX.sym("v")
    model = Model(name="oscillator", x=ca.vertcat(X, v), u=U, f=ca.vertcat(v, -(w**2) * X + U))
    ocp = OCP(name="truth", model=model, x0=[1.0, 0.0], horizon=1.0, running_cost=X**2)
    return trajectory(ocp, np.zeros((n, 1))), 0.5 + sin(2 * w) / (4 * w)


def stiff_tracking(rng: np.random.Generator) -> tuple[Solution, float]:
    """dx/dt = -rate (x - cos t) + u, u linear from node to node; by Radau at 1e-11."""
    rate, n = 10 ** rng.uniform(2, 6), int(rng.integers(3, 20))
    ocp = problem(-rate * (X - ca.cos(T)) + U, X**2, horizon=10.0)
    u = sqrt(rate) * rng.normal(size=(n, 1))
    near = np.cos(np.linspace(0.0, 10.0, n))[:, None]
    solution = trajectory(ocp, u, "linear", x=near)
    y = np.zeros(2)
    for (a, b), (ua, ub) in zip(pairwise(solution.t), pairwise(u[:, 0]), strict=True):

        def rates(t: float, y: np.ndarray, a=a, b=b, ua=ua, ub=ub) -> list[float]:
            control = ua + (ub - ua) * (t - a) / (b - a)
            return [-rate * (y[0] - np.cos(t)) + control, y[0] ** 2]

        y = solve_ivp(rates, (a, b), y, method="Radau", rtol=1e-11, atol=1e-13).y[:, -1]
    return solution, float(y[1])


Kind = Callable[[np.random.Generator], tuple[Solution, float]]
KINDS: list[Kind] = [stiff, unstable, spike, jump, many_nodes, stiff_tracking]


def error_and_bar(kind: Kind, seed: int) -> tuple[float, float]:
    """True error and the bar, relative to the cost."""
    solution, cost = kind(np.random.default_rng(seed))
    verdict = evaluate(solution)
    return abs(verdict.cost - cost) / abs(cost), verdict.cost_error / abs(cost)


@pytest.mark.many
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("kind", KINDS)
def test_the_cost_is_within_its_own_error_bar(kind: Kind, seed: int) -> None:
    error, bar = error_and_bar(kind, seed)
    assert error <= bar + FLOOR
    assert bar <= 1e-2


@pytest.mark.slow
def test_a_hundred_costs_are_within_their_bars_and_the_bars_are_narrow() -> None:
    found = np.array([error_and_bar(KINDS[seed % len(KINDS)], seed) for seed in range(2, 102)])
    error, bar = found.T
    assert (error <= bar + FLOOR).all()
    assert (bar <= WIDE * np.maximum(error, FLOOR)).mean() >= 0.9


def verdict_on(f: ca.SX, running_cost: ca.SX, intervals: int, **changes) -> Evaluation:
    ocp = problem(f, running_cost, **changes)
    return evaluate(trajectory(ocp, np.zeros((intervals, 1))))


def test_a_wave_that_two_grids_take_for_a_constant() -> None:
    """The mean of sin^2(1600 pi t) is 1/2; on 400 and on 800 equal steps it is always zero."""
    verdict = verdict_on(U, ca.sin(1600 * ca.pi * T) ** 2, 10)
    assert verdict.cost == pytest.approx(0.5, abs=verdict.cost_error + FLOOR)
    moved = verdict_on(3 * ca.sin(4800 * ca.pi * T) ** 2 + U, X, 75)
    assert moved.cost == pytest.approx(0.75, rel=1e-6)  # x = 3 t / 2 but for a ripple of 1e-4


@pytest.mark.slow
def test_no_error_is_claimed_that_was_not_measured() -> None:
    """Thousands of nodes: the steps are shortened twice at least."""
    solution, cost = many_nodes(np.random.default_rng(3))
    count = len(solution.t) - 1
    verdict = evaluate(solution)
    assert len(verdict.truth.t) - 1 >= 3 * count
    assert 0.0 < verdict.cost_error < 1e-2 * cost


def test_says_how_far_apart_it_looks() -> None:
    verdict = verdict_on(U, X**2, 10)
    assert verdict.resolution == pytest.approx(np.diff(verdict.truth.t).max())
    assert verdict.resolution <= 1.0 / 150


def test_what_no_method_resolves_is_no_blow_up() -> None:
    """A rate that is no number for x < -1/2, which x = -t enters at half time."""
    verdict = verdict_on(-1.0 + 1e-3 * ca.sqrt(X + 0.5) + U, X**2, 4)
    assert verdict.cost == np.inf
    assert verdict.cost_error == np.inf
    assert verdict.worst == f"not resolved in {len(verdict.truth.t) - 1} steps"
    assert verdict.stationarity is None


# -- by segments ----------------------------------------------------------------------


def test_rounding_is_not_amplified_where_the_nodes_are_right() -> None:
    solution, cost = unstable(np.random.default_rng(28))
    strong = trajectory(
        problem(34.0 * X + U, X**2 + U**2, x0=1.0), np.zeros((80, 1)), x=np.zeros((81, 1))
    )
    assert evaluate(strong).replay == "open loop"  # its own states are wrong: applied as it is
    verdict = evaluate(solution)
    assert verdict.cost == pytest.approx(cost, rel=1e-8)


def pulled_back(rate: float, n: int = 200) -> tuple[Solution, float]:
    """dx/dt = rate x + u with u held, from 1 towards 0 as e^(-rate t); its cost."""
    h = 1.0 / n
    factor = (exp(-rate * h) - exp(rate * h)) * rate / expm1(rate * h)
    u = factor * np.exp(-rate * h * np.arange(n))
    nodes = np.exp(-rate * h * np.arange(n + 1))[:, None]
    ocp = problem(rate * X + U, X**2 + U**2, x0=1.0)
    one = h * float(u @ u) + sum(
        settled(-rate, x, np.array([v]), h)[0] for x, v in zip(nodes[:-1, 0], u, strict=True)
    )
    return trajectory(ocp, u[:, None], x=nodes), one


def test_unstable_dynamics_are_judged_from_node_to_node() -> None:
    """Growth e^30 = 1e13: open loop ends at 1e-3 instead of 1e-13, by rounding alone."""
    solution, cost = pulled_back(33.0)
    verdict = evaluate(solution.with_(costate=2.0 * solution.x))
    assert verdict.replay == "by segments"
    assert verdict.cost == pytest.approx(cost, rel=1e-9)
    assert verdict.gap is not None
    assert verdict.gap <= 1e-8
    assert verdict.growth == pytest.approx(exp(33.0), rel=1e-2)
    assert verdict.stationarity is None


def test_gaps_count_with_what_they_are_worth() -> None:
    """To first order a gap changes the cost by costate times gap."""
    solution, _ = pulled_back(33.0)
    x = solution.x.copy()
    x[100] += 1e-6
    off = solution.with_(x=x, costate=np.full_like(x, 5.0))
    verdict = evaluate(off)
    assert verdict.replay == "by segments"
    # The displaced node opens two gaps: the end before it misses it, and it misses the next.
    worth = 5.0 * 1e-6 * abs(exp(33.0 / 200) - 1.0)
    assert verdict.cost_error == pytest.approx(worth, rel=0.05)


def test_whole_numbers_are_controls_too() -> None:
    """A switching, say, may come as an array of ints."""
    ocp, u = problem(-X + U, X**2 + U**2), np.array([[1], [0], [1]])
    found = trajectory(ocp, u)
    assert evaluate(found.with_(u=u)).stationarity == evaluate(found).stationarity
