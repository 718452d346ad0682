"""Orders of convergence, and multipliers that are costates: the covector mapping."""

import numpy as np
import pytest

from models.textbook import bryson_denham, van_der_pol
from ocp import OCP, Solution, evaluate, solve
from solvers import Collocation, Mesh, MultipleShooting, polish
from solvers.collocation.collocation_points import Family
from tests.solvers.problems import timed_transfer, tracker
from tests.solvers.test_agreement import slope
from tests.tolerances import CERTIFIED, COST_DERIVATIVE, MINIMISER, ORDER

both = pytest.mark.parametrize("points", ["radau", "gauss"])


@pytest.fixture(scope="module")
def exact() -> Solution:
    return polish(solve(van_der_pol(), MultipleShooting(200)), accuracy=1e-12)


def errors(points: Family, degree: int, intervals: int, exact: Solution) -> list[float]:
    """Of cost, states and costates at the edges, and costates at the points."""
    solver = Collocation(intervals, degree, points, tolerance=1e-12)
    solution = solve(van_der_pol(), solver)
    edges = solution.breaks
    t = solution.t[edges]
    return [
        abs(solution.cost - exact.cost),
        np.abs(solution.x[edges] - exact.state(t)).max(),
        np.abs(solution.costate[edges] - exact.costate_at(t)).max(),
        np.abs(solution.costate - exact.costate_at(solution.t)).max(),
    ]


@pytest.mark.many
@pytest.mark.parametrize(
    ("points", "degree", "counts", "order"),
    [
        ("radau", 2, (16, 32), 3),
        ("radau", 3, (16, 32), 5),
        ("gauss", 2, (8, 16), 4),
        ("gauss", 3, (8, 16), 6),
    ],
)
def test_orders(
    points: Family, degree: int, counts: tuple[int, int], order: int, exact: Solution
) -> None:
    """2d - 1 and 2d at the edges, for states, costates and cost; d to d + 1 at the points.

    From degree 4 on, rounding (2e-11 in the states of the extremal) is met before the order.
    """
    coarse, fine = (errors(points, degree, n, exact) for n in counts)
    got = np.log2(np.array(coarse) / np.array(fine))
    np.testing.assert_allclose(got[:3], order, atol=ORDER)
    assert degree - ORDER <= got[3] <= degree + 1 + ORDER


@both
@pytest.mark.parametrize("degree", [4, 5])
def test_high_degrees_reach_the_optimum(points: Family, degree: int, exact: Solution) -> None:
    cost, x, costate, at_points = errors(points, degree, 24, exact)
    assert cost <= 1e-11
    assert max(x, costate) <= 1e-8
    assert at_points <= 1e-5


@pytest.mark.many
@both
@pytest.mark.parametrize("make", [van_der_pol, tracker, timed_transfer])
def test_costates_are_slopes_of_the_optimal_cost(make, points: Family) -> None:
    """dJ*/dx0 by differences of whole optimisations, in every kind of problem."""
    ocp: OCP = make()
    program = Collocation(12, points=points, tolerance=1e-11).build(ocp)
    solution = program.run()

    def cost(x0: np.ndarray) -> float:
        return program.run(x0=x0, guess=solution).or_raise().cost

    size = np.abs(solution.costate).max()
    np.testing.assert_allclose(
        solution.costate[0], slope(cost, ocp.start()), atol=COST_DERIVATIVE * size
    )


def test_costates_start_an_indirect_method_at_its_solution() -> None:
    direct = solve(van_der_pol(), Collocation(20, 5, points="gauss"))
    extremal = polish(direct)
    assert extremal.iterations <= 2
    np.testing.assert_allclose(extremal.costate[0], direct.costate[0], atol=CERTIFIED)
    np.testing.assert_allclose(
        extremal.costate_at(direct.t[direct.breaks]), direct.costate[direct.breaks], atol=MINIMISER
    )


def test_where_a_state_bound_is_active_the_side_after_the_node_is_kept() -> None:
    r"""Bryson-Denham with l = 1/9: the costate of x jumps from -2/(9 l^2) = -18 to 0 at 1/3.

    On the first arc u = -2/(3l) (1 - t/(3l)) = -6 + 18 t and lambda_v = -u, so that
    lambda_x = -d lambda_v / dt = 18; on the boundary arc both are 0; on the last one
    lambda_x = -18. So it jumps by -18 at 1/3, and again at 2/3.
    """
    mesh = Mesh((0.0, 1 / 6, 1 / 3, 2 / 3, 5 / 6, 1.0), (3,) * 5)
    solution = solve(bryson_denham(), Collocation(mesh=mesh, tolerance=1e-11))
    at_edges = solution.costate[solution.breaks]
    np.testing.assert_allclose(at_edges[:, 0], [18.0, 18.0, 0.0, -18.0, -18.0, -18.0], atol=1e-3)
    t = solution.t[solution.breaks]
    u = np.where(t < 1 / 3, -6 + 18 * t, np.where(t < 2 / 3, 0.0, 12 - 18 * t))
    np.testing.assert_allclose(at_edges[:, 1], -u, atol=1e-3)
    assert evaluate(solution).cost == pytest.approx(4.0, rel=CERTIFIED)
