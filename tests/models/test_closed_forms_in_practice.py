"""Closed forms of fishing, digging, spending, turning round, cooling, and of ways around discs."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar

from benchmarks.cases import LIBRARY
from models.textbook import rod_pendulum
from models.textbook.around_discs import CENTRES, END, SQUARE
from ocp import OCP, Constraint, Model, solve
from solvers import Collocation
from tests.tolerances import CERTIFIED, ROUNDING

CASES = {case.name: case for case in LIBRARY}

# -- one stock of fish: full, singular, full ---------------------------------------------------


def growth(x: float) -> float:
    return 0.71 * x * (1.0 - x / 80.5)


def price(x: float) -> float:
    return 1.0 - 17.5 / x


def singular_stock() -> float:
    """Where the derivative of growth times price vanishes."""
    slope = np.polyder(np.poly1d([-1.0 / 80.5, 1.0]) * np.poly1d([1.0, -17.5]))
    return float(slope.roots[0])


def emptied(x: float, left: float) -> tuple[float, float]:
    """Profit and stock after a time at full effort."""

    def rate(t: float, z: np.ndarray) -> list[float]:
        return [growth(z[0]) - 20.0, 20.0 * price(z[0])]

    end = solve_ivp(rate, (0.0, left), [x, 0.0], method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    return float(end[1]), float(end[0])


def fishery() -> float:
    best = singular_stock()
    arrival = quad(lambda x: 1.0 / (growth(x) - 20.0), 70.0, best, epsabs=1e-13)[0]
    first = quad(lambda x: 20.0 * price(x) / (growth(x) - 20.0), 70.0, best, epsabs=1e-12)[0]

    def cost(last: float) -> float:
        held = (10.0 - last - arrival) * growth(best) * price(best)
        return -(first + held + emptied(best, last)[0])

    found = minimize_scalar(cost, bounds=(0.1, 5.0), method="bounded", options={"xatol": 1e-7})
    return float(found.fun)


# -- a string around discs ----------------------------------------------------------------------


def string(first: int, second: int | None) -> float:
    """Length with each disc on the left (1) or the right (-1); None: the second is not touched."""
    radius = np.sqrt(SQUARE)
    ends, sides = [np.zeros(2), np.array(END)], [s for s in (first, second) if s is not None]
    centres = [np.array(c) for c in CENTRES[: len(sides)]]
    points, signs = [ends[0], *centres, ends[1]], [0, *sides, 0]
    length, headings = 0.0, []
    for (a, b), (s, t) in zip(pairwise(points), pairwise(signs), strict=True):
        way, across = b - a, radius * (t - s)
        straight = np.sqrt(way @ way - across**2)
        headings.append(np.arctan2(way[1], way[0]) - np.arctan2(across, straight))
        length += straight
    turns = [s * (b - a) for s, (a, b) in zip(sides, pairwise(headings), strict=True)]
    assert min(turns) > 0.0  # else it is not pulled round that disc
    return length + radius * sum(turns)


def test_the_string_keeps_off_the_second_disc() -> None:
    """The best way: its last tangent passes there; the published one is between the discs."""
    case = CASES["around-discs"]
    with pytest.raises(AssertionError):
        string(1, 1)
    assert string(-1, 1) == pytest.approx(case.local_costs[0], rel=ROUNDING)
    assert min(string(-1, 1), string(1, -1), string(-1, -1)) > string(1, None)
    heading = np.arctan2(1.1, 0.8) + np.arcsin(np.sqrt(SQUARE / 1.85))
    off = np.array(END) - np.array(CENTRES[1])
    assert abs(off[0] * np.sin(heading) - off[1] * np.cos(heading)) > np.sqrt(SQUARE) + 0.01


# -- spending and digging: the control, driven through the model ----------------------------------


def spent(t: float) -> float:
    rate: Any = brentq(
        lambda k: (
            quad(lambda s: np.exp(-s / 20.0) * (100.0 + k * np.exp(-s / 40.0)), 0, 10)[0] - 100.0
        ),
        -200.0,
        0.0,
        xtol=1e-13,
    )
    return 100.0 + rate * np.exp(-t / 40.0)


def driven(name: str, control: Callable[[float], float]) -> float:
    """The cost of a control, which ends where it has to."""
    ocp = CASES[name].build()

    def rate(t: float, z: np.ndarray) -> list[float]:
        f, cost = ocp.functions.rate(z[0], u := control(t), t, []), ocp.functions.running_cost
        return [float(f), float(cost(z[0], u, t, []))]

    start = [float(ocp.start()[0]), 0.0]
    span = (0.0, ocp.duration)
    end = solve_ivp(rate, span, start, method="DOP853", rtol=1e-12, atol=1e-11).y[:, -1]
    for c in ocp.at("terminal"):
        value = ca.Function("c", [ocp.model.x], [c.expression])(end[0])
        assert float(value) == pytest.approx(float(np.asarray(c.lower)[0]), abs=1e-7)
    return float(end[1])


def consumption() -> float:
    first = spent(0.0) - 100.0
    return driven("consumption", lambda t: 100.0 + first * np.exp(-t / 40.0))


# -- a rod: Riccati's equation without its ends ---------------------------------------------------


def heated_rod() -> float:
    """The recursion over short steps, since the exponential over all of them loses its digits."""
    inside, width, take = 5, 1.0 / 6.0, 2.0
    share = 1.0 / (1.0 + take * width)  # of the first inner temperature in that of the end
    a = np.diag(np.full(inside, -2.0)) + np.eye(inside, k=1) + np.eye(inside, k=-1)
    a[0, 0] += share
    a[-1, -1] += 1.0
    b = np.zeros((inside, 1))
    b[0] = 1.0 - share
    a, b = 0.2 / width**2 * a, 0.2 / width**2 * b
    steps, p = 50, np.zeros((inside, inside))
    flow = expm(2.0 / steps * np.block([[a, -b @ b.T / 1e-2], [-width * np.eye(inside), -a.T]]))
    (f, g), (h, i) = (np.hsplit(rows, 2) for rows in np.vsplit(flow, 2))
    for _ in range(steps):
        p = np.linalg.solve(i - p @ g, p @ f - h)
    return float(np.ones(inside) @ p @ np.ones(inside))


# -- the largest value ----------------------------------------------------------------------------


def least_jerk() -> float:
    """The bound that a jerk of three arcs needs to go 1 in 1, from rest to rest."""
    v = [np.poly1d([0.5, 0.0, 0.0]), np.poly1d([-0.5, 0.25, 0.03125])]  # from each arc's start
    way = 2.0 * (v[0].integ()(0.25) + v[1].integ()(0.25))
    return 1.0 / way


def least_excursion() -> float:
    """The wall before which the least effort, 4/(9 l), is the budget."""
    budget = 4.0
    root: Any = brentq(lambda wall: 4.0 / (9.0 * wall) - budget, 0.01, 1.0 / 6.0, xtol=1e-15)
    return float(root)


ROOTS: dict[str, Callable[[], float]] = {
    "fishery": fishery,
    "around-discs": lambda: string(1, None),
    "consumption": consumption,
    "mine": lambda: driven("mine", lambda t: 5.0 * (6.0 - t) / 9.0),
    "least-jerk": least_jerk,
    "least-excursion": least_excursion,
    "heated-rod": heated_rod,
}


@pytest.mark.parametrize("name", ROOTS)
def test_the_derivation_gives_the_reference(name: str) -> None:
    reference = CASES[name].reference
    assert reference is not None
    assert ROOTS[name]() == pytest.approx(reference.value, rel=CERTIFIED, abs=reference.error)


def test_the_pendulum_on_a_rod_is_the_one_in_the_angle() -> None:
    """Cartesian coordinates with the force of the rod, and the angle from straight below."""
    angle, rate, push = (ca.SX.sym(name) for name in ("angle", "rate", "push"))
    below = Constraint("below", ca.vertcat(angle, rate), [0.0, 0.0], [0.0, 0.0], at="terminal")
    swing = OCP(
        name="angle",
        model=Model(
            name="pendulum",
            x=ca.vertcat(angle, rate),
            u=push,
            f=ca.vertcat(rate, -9.81 * ca.sin(angle) - push),
        ),
        x0=[np.pi / 2.0, 0.0],
        horizon=3.0,
        running_cost=push**2,
        constraints=(below,),
    )
    on_its_rod = solve(rod_pendulum(), Collocation(20, degree=5)).or_raise()
    found = solve(swing, Collocation(20, degree=5)).or_raise()
    assert found.cost == pytest.approx(on_its_rod.cost, rel=1e-7)
    drift = (on_its_rod.x[:, :2] ** 2).sum(axis=1) - 1.0
    assert np.abs(drift).max() < 1e-5  # what 20 intervals leave: no equation holds it
    np.testing.assert_allclose(on_its_rod.x[:, 0], np.sin(found.x[:, 0]), atol=1e-4)


def test_no_other_stock_is_better_on_the_singular_arc() -> None:
    best = singular_stock()
    assert best == pytest.approx(49.0, rel=ROUNDING)
    around = growth(best) * price(best)
    assert all(growth(x) * price(x) < around for x in (best - 0.01, best + 0.01))
