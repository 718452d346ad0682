"""Polynomial controls: their values and bounds, and the referee on them."""

from math import comb
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ocp import Box, ProblemError, Solution, costates_along, evaluate
from ocp.solution.piecewise_polynomial import PiecewisePolynomial, bernstein, elevated
from ocp.solution.shifted_plan import ShiftedPlan, plan_controls
from tests.ocp.differences import gradient
from tests.ocp.problems import DURATION, energy, integrator, pendulum, trajectory
from tests.tolerances import MINIMISER, REFEREE, ROUNDING, STATIONARY

T = np.array([0.0, 0.1, 0.45, 0.6, 1.1, DURATION])
BREAKS = np.array([0, 2, 3, 5])
U_1 = ([0.5, 2.0, -1.5], [0.2, 0.4, 1.0], [0.1, -0.7, 0.3])
U_2 = ([-1.0, 0.3, 0.1], [0.9, 0.4, -0.3], [0.0, 0.2, 0.5])
C = np.stack([np.ravel(U_1), np.ravel(U_2)], axis=1)


def curved(**changes: Any) -> Solution:
    """Three parabolas on unequal pieces of the pendulum's horizon."""
    ocp = changes.pop("ocp", None) or pendulum()
    nothing = np.zeros((len(T), 2))
    given = {"t": T, "x": nothing, "costate": nothing, "breaks": BREAKS, "u": C}
    return trajectory(ocp, np.zeros((5, 2))).with_(control_kind="polynomial", **(given | changes))


counts = st.integers(1, 6)


@given(counts, st.integers(0, 2**32 - 1), st.integers(0, 3))
@settings(max_examples=40, deadline=None)
def test_bernstein_is_its_definition_and_stays_within_its_coefficients(
    count: int, seed: int, more: int
) -> None:
    rng = np.random.default_rng(seed)
    rows, s = rng.normal(size=(count, 2)), rng.uniform(size=7)
    degree = count - 1
    weights = [comb(degree, i) * s**i * (1 - s) ** (degree - i) for i in range(count)]
    expected = np.stack(weights, axis=1) @ rows
    got = bernstein(np.tile(rows, (7, 1, 1)), s)
    np.testing.assert_allclose(got, expected, atol=ROUNDING)
    assert (got <= rows.max(axis=0) + ROUNDING).all()
    higher = elevated(rows, count + more)
    assert len(higher) == count + more
    np.testing.assert_allclose(bernstein(np.tile(higher, (7, 1, 1)), s), expected, atol=ROUNDING)


def test_equal_coefficients_are_met_without_rounding() -> None:
    """A control on its bound stays on it."""
    rows = np.full((100, 5, 1), 0.1)
    np.testing.assert_array_equal(bernstein(rows, np.linspace(0, 1, 100)), 0.1)


def test_edges_belong_to_the_piece_that_begins() -> None:
    solution = curved()
    np.testing.assert_allclose(
        solution.control([-1.0, 0.0, 0.45, 0.6, DURATION, 9.0]), C[[0, 0, 3, 6, 8, 8]]
    )
    np.testing.assert_allclose(solution.control(0.225), C[:3].T @ [0.25, 0.5, 0.25])
    np.testing.assert_array_equal(plan_controls(solution, T), solution.control(T))
    left = solution.pieces.at(np.array([0.45]), np.array([0]))
    np.testing.assert_allclose(left, C[[2]])


def test_slopes_of_the_values_are_the_basis() -> None:
    pieces = curved().pieces
    t = np.array([0.3, 0.5, 1.4])
    piece = pieces.of(t)
    by_basis = np.einsum("pm,pmn->pn", pieces.basis(t, piece), pieces.coefficients[piece])
    np.testing.assert_allclose(by_basis, pieces.at(t), atol=ROUNDING)


def test_a_line_is_a_line() -> None:
    """The same control as linear nodes and as polynomials: the referee sees no difference."""
    u = np.array([[0.5, -1.0], [2.0, 0.3], [-1.5, 0.1], [0.2, 0.9], [0.3, 0.3], [0.4, -0.4]])
    linear = trajectory(pendulum(), u, "linear", t=T)
    rows = np.repeat(u, 2, axis=0)[1:-1]
    same = linear.with_(control_kind="polynomial", u=rows, breaks=np.arange(6))
    one, other = evaluate(linear), evaluate(same)
    assert one.cost == pytest.approx(other.cost, abs=REFEREE)
    np.testing.assert_allclose(one.truth.x[-1], other.truth.x[-1], atol=REFEREE)


def test_the_referee_integrates_a_parabola_exactly() -> None:
    """dx/dt = u with u = 4 t (1 - t), cost int u^2 = 8/15: coefficients 0, 2, 0."""
    nodes = np.zeros((3, 1))
    solution = trajectory(integrator(), np.zeros((2, 1)), x=nodes, costate=nodes).with_(
        control_kind="polynomial", u=np.array([[0.0], [2.0], [0.0]]), breaks=np.array([0, 2])
    )
    verdict = evaluate(solution)
    assert verdict.cost == pytest.approx(8.0 / 15.0, rel=1e-9)
    assert verdict.truth.x[-1, 0] == pytest.approx(2.0 / 3.0, abs=ROUNDING)


@pytest.mark.slow
def test_costates_and_stationarity_are_derivatives_of_the_cost() -> None:
    """abs(u - (u - dJ/dc / weight)) with dJ/dc by differences; costates by moving the start."""
    ocp = pendulum()
    solution = curved(ocp=ocp)
    slope = gradient(lambda x: evaluate(curved(ocp=ocp, x0=x)).cost, ocp.start(), step=1e-3)
    np.testing.assert_allclose(costates_along(solution).costate[0], slope, atol=MINIMISER)
    flat = gradient(
        lambda c: evaluate(curved(ocp=ocp, u=c.reshape(C.shape))).cost, C.ravel(), step=1e-3
    ).reshape(3, 3, 2)
    weight = np.diff(T[BREAKS])[:, None, None] / 3
    assert evaluate(solution).stationarity == pytest.approx(
        np.abs(flat / weight).max(), abs=10 * MINIMISER
    )


def test_the_optimal_line_is_stationary() -> None:
    """Double integrator: u = 6 - 12 t is a polynomial on any pieces."""
    t = np.array([0.0, 0.2, 0.7, 1.0])
    u = 6.0 - 12.0 * np.array([[0.0, 0.1, 0.2], [0.2, 0.45, 0.7], [0.7, 0.85, 1.0]]).reshape(-1, 1)
    given: dict[str, Any] = {"t": t, "u": u, "breaks": np.arange(4)}
    costate = np.stack([np.full(4, -12.0), 12.0 * t - 6.0], axis=1)
    solution = trajectory(energy(), np.zeros((3, 1)), costate=costate).with_(
        control_kind="polynomial", **given
    )
    verdict = evaluate(solution)
    assert verdict.cost == pytest.approx(6.0, abs=REFEREE)
    assert verdict.stationarity is not None
    assert verdict.stationarity <= STATIONARY


def test_a_control_within_its_bounds_violates_nothing() -> None:
    top = pendulum(control_bounds=Box(-1.5, [2.0, 0.9]))
    assert evaluate(curved(ocp=top)).violation == 0.0
    low = pendulum(control_bounds=Box(-1.5, [2.0, 0.3]))
    # The second piece begins with 0.9.
    assert evaluate(curved(ocp=low)).violation == pytest.approx(0.6, abs=ROUNDING)


def test_shifted_plan_keeps_its_controls() -> None:
    plan, fractions = curved(), np.linspace(0.0, 1.0, 9)
    u = ShiftedPlan(plan, 0.3).sample("u", fractions, plan.problem.model.nu)
    np.testing.assert_array_equal(u, plan.control(0.3 + fractions * DURATION))


def test_on_disk_with_and_without_breaks(tmp_path: Path) -> None:
    solution = curved()
    back = Solution.load(solution.save(tmp_path / "curved"), solution.problem)
    assert back.control_kind == "polynomial"
    np.testing.assert_array_equal(back.breaks, BREAKS)
    assert evaluate(back).cost == evaluate(solution).cost
    held = trajectory(pendulum(), C[:4])
    path = held.save(tmp_path / "held")
    with np.load(path) as file:
        content: dict[str, Any] = {name: file[name] for name in file.files if name != "breaks"}
    np.savez(path, **content)
    assert Solution.load(path, held.problem).breaks.size == 0


def test_plot_shows_the_curve() -> None:
    lines = curved().plot()["u_0"].get_lines()
    assert len(np.asarray(lines[0].get_xdata())) > 100


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"breaks": np.array([0, 3, 2, 5])}, "increase from 0 to 5"),
        ({"breaks": np.array([1, 5])}, "increase from 0 to 5"),
        ({"breaks": np.array([0, 4])}, "increase from 0 to 5"),
        ({"breaks": np.array([], dtype=int)}, "increase from 0 to 5"),
        ({"u": C[:8]}, r"u has shape \(8, 2\), \(6, 2\) is needed"),
        ({"u": C[:2]}, r"u has shape \(2, 2\), \(3, 2\) is needed"),
        ({"u": C[:, :1]}, r"u has shape \(9, 1\), \(9, 2\) is needed"),
    ],
)
def test_refuses(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        curved(**changes)


def test_one_coefficient_is_a_held_control() -> None:
    one = PiecewisePolynomial(np.array([0.0, 1.0]), np.ones((1, 1, 1)))
    np.testing.assert_array_equal(one.at(np.array([0.0, 0.5, 1.0])), 1.0)
