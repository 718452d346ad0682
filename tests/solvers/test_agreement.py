"""Direct and indirect methods agree: costs, costates, and the slope of the optimal cost."""

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.cases import TEXTBOOK, Case, arm_cases
from models.textbook import (
    bryson_denham,
    double_integrator_energy,
    double_integrator_minimum_time,
    van_der_pol,
)
from ocp import Program, Solver, Status, evaluate, solve
from solvers import Collocation, IndirectShooting, MultipleShooting, polish
from tests.tolerances import (
    CERTIFIED,
    COST_DERIVATIVE,
    COST_STEP,
    DIRECT_COST,
    DIRECT_COSTATE,
    MINIMISER,
    ORDER,
    RESIDUAL,
)

CASES = {case.name: case for case in (*TEXTBOOK, *arm_cases())}


def slope(cost: Callable[[np.ndarray], float], x0: np.ndarray) -> np.ndarray:
    """dJ*/dx0 by differences, without the error of second order (Richardson)."""

    def central(step: float) -> np.ndarray:
        return np.array(
            [(cost(x0 + e) - cost(x0 - e)) / (2 * step) for e in step * np.eye(len(x0))]
        )

    return (4.0 * central(COST_STEP / 2) - central(COST_STEP)) / 3.0


@pytest.mark.parametrize(
    "name", ["van-der-pol", pytest.param("arm-002-sum", marks=pytest.mark.slow)]
)
def test_costates_are_slopes_of_the_optimal_cost(name: str) -> None:
    case = CASES[name]
    ocp = case.build()
    direct = MultipleShooting(200).build(ocp)
    indirect = IndirectShooting(segments=15, steps=600).build(ocp)
    held, extremal = direct.run(), indirect.run(guess=direct.run())
    x0 = ocp.start()

    def cost_of(program: Program, guess) -> Callable[[np.ndarray], float]:
        return lambda x: program.run(x0=x, guess=guess).or_raise().cost

    assert held.cost == pytest.approx(extremal.cost, rel=DIRECT_COST)
    size = np.abs(extremal.costate).max()
    np.testing.assert_allclose(
        held.costate, extremal.costate_at(held.t), atol=DIRECT_COSTATE * size
    )
    for program, solution in ((direct, held), (indirect, extremal)):
        np.testing.assert_allclose(
            solution.costate[0], slope(cost_of(program, solution), x0), atol=COST_DERIVATIVE * size
        )


@pytest.mark.many
@pytest.mark.parametrize("name", ["double-integrator-energy", "arm-001-sum", "arm-003-sum"])
def test_costates_of_the_reference(name: str) -> None:
    case = CASES[name]
    held = solve(case.build(), MultipleShooting(200))
    extremal = polish(held)
    assert case.costate0 is not None
    expected = np.array(case.costate0)
    size = np.abs(expected).max()
    np.testing.assert_allclose(held.costate[0], expected, atol=DIRECT_COSTATE * size)
    # The library prints 8 digits, of which the data hold about 6.
    np.testing.assert_allclose(extremal.costate[0], expected, atol=MINIMISER * size)


@pytest.mark.parametrize(
    ("name", "intervals"),
    [
        ("van-der-pol", 75),
        ("rayleigh", 75),
        pytest.param("hypersensitive", 300, marks=pytest.mark.slow),
    ],
)
def test_certified_optima(name: str, intervals: int) -> None:
    case: Case = CASES[name]
    solution = polish(solve(case.build(), MultipleShooting(intervals)), accuracy=1e-10)
    assert solution.status is Status.SOLVED
    assert solution.residual <= RESIDUAL
    gap = case.gap(evaluate(solution).cost)
    assert gap is not None
    assert abs(gap) <= CERTIFIED


@pytest.mark.many
@pytest.mark.parametrize(
    "solver",
    [
        MultipleShooting(150),
        MultipleShooting(150, backend="fatrop"),
        Collocation(3, 3),
        Collocation(3, 3, points="gauss"),
        IndirectShooting(),
        IndirectShooting(segments=15),
        IndirectShooting(jacobian="finite-difference"),
    ],
    ids=repr,
)
def test_least_energy_is_six(solver: Solver) -> None:
    solution = solve(double_integrator_energy(), solver)
    # u held on N intervals: the optimum is 6 N^2/(N^2 - 1).
    exact = 6.0 * 150**2 / (150**2 - 1) if isinstance(solver, MultipleShooting) else 6.0
    assert evaluate(solution).cost == pytest.approx(exact, rel=CERTIFIED)
    t = (solution.t[1:] + solution.t[:-1]) / 2 if solution.control_kind == "held" else solution.t
    np.testing.assert_allclose(solution.control(t)[:, 0], 6.0 - 12.0 * t, atol=DIRECT_COSTATE)
    np.testing.assert_allclose(solution.costate[0], [-12.0, -6.0], rtol=DIRECT_COSTATE)


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_minimum_time_is_bang_bang(backend) -> None:
    """40 intervals of 1/20 s: the switch at t = 1 is a node, so the answer is exact."""
    solution = solve(double_integrator_minimum_time(), MultipleShooting(40, backend=backend))
    assert solution.status is Status.SOLVED
    assert evaluate(solution).cost == pytest.approx(2.0, abs=CERTIFIED)
    assert solution.t[-1] == pytest.approx(2.0, abs=CERTIFIED)
    np.testing.assert_allclose(solution.u[:20, 0], 1.0, atol=MINIMISER)
    np.testing.assert_allclose(solution.u[20:, 0], -1.0, atol=MINIMISER)


def test_bryson_denham_converges_with_second_order() -> None:
    """3 divides the numbers of intervals: the ends of the arc at 1/3, 2/3 are nodes."""
    counts = np.array([15, 30, 60, 120])
    gaps = [solve(bryson_denham(), MultipleShooting(int(n))).or_raise().cost - 4.0 for n in counts]
    orders = -np.diff(np.log(gaps)) / np.diff(np.log(counts))
    np.testing.assert_allclose(orders, 2.0, atol=ORDER)


def test_a_direct_answer_gets_better_with_second_order() -> None:
    reference = CASES["van-der-pol"].reference
    assert reference is not None
    exact = reference.value
    gaps = [solve(van_der_pol(), MultipleShooting(n)).cost - exact for n in (25, 50, 100)]
    np.testing.assert_allclose(-np.diff(np.log2(gaps)), 2.0, atol=ORDER)
