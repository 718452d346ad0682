"""Refinement: the mesh goes where it is needed, and the optimum holds to the promised digits."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from models.textbook import (
    bryson_denham,
    discrete_double_integrator,
    double_integrator_minimum_time,
    hypersensitive,
    rayleigh,
    van_der_pol,
)
from ocp import OCP, ProblemError, Status, UnsupportedProblem, evaluate, solve
from solvers import Collocation, MultipleShooting, polish, refine_mesh
from solvers.collocation.collocation_points import Family
from tests.solvers.problems import OTHER, tracker
from tests.solvers.test_failures import braked
from tests.tolerances import CERTIFIED, ROUNDING

both = pytest.mark.parametrize("points", ["radau", "gauss"])


@both
@pytest.mark.parametrize(
    ("make", "reference"),
    [
        (van_der_pol, 1.047806908220),
        pytest.param(rayleigh, 29.376079655945, marks=pytest.mark.slow),
        pytest.param(hypersensitive, 1.330806904945, marks=pytest.mark.slow),
    ],
)
def test_certified_optima(make: Callable[[], OCP], reference: float, points: Family) -> None:
    """To more than 8 digits, by the solver's word and by the referee's."""
    ocp = make()
    start = solve(ocp, MultipleShooting(40))
    found = refine_mesh(start, solver=Collocation(10, points=points))
    solution, verdict = found.solution, evaluate(found.solution)
    assert solution.status is Status.SOLVED
    assert solution.cost == pytest.approx(reference, rel=1e-9)
    assert verdict.cost == pytest.approx(reference, rel=1e-9)
    assert verdict.violation <= 1e-9
    assert verdict.stationarity is not None
    assert verdict.stationarity <= 1e-5
    assert found.rounds[-1].error <= 1e-8 < found.rounds[0].error


@pytest.mark.over_library
@pytest.mark.slow
@pytest.mark.parametrize("name", ["arm-001", "arm-002", "arm-003", "arm-004"])
def test_the_arm_agrees_with_its_extremal(name: str) -> None:
    """Its cost is C1 only, so the quadrature is refined as well: the true cost has 10 digits."""
    solution = refine_mesh(solve(arm_scenario(name).ocp(), MultipleShooting(75))).solution
    assert solution.status is Status.SOLVED
    extremal = polish(solution, accuracy=1e-10)
    assert evaluate(solution).cost == pytest.approx(extremal.cost, rel=CERTIFIED)
    assert solution.cost == pytest.approx(extremal.cost, rel=1e-7)


@pytest.mark.slow
def test_history_tells_where_the_mesh_went() -> None:
    """Hypersensitive: short intervals at both ends, long ones between; nothing is coarsened."""
    found = refine_mesh(solve(hypersensitive(), MultipleShooting(40)))
    sizes = [sum(r.mesh.degrees) for r in found.rounds]
    assert sizes == sorted(set(sizes))
    for coarse, fine in pairwise(found.rounds):
        assert set(coarse.mesh.edges) <= set(fine.mesh.edges)
    widths = found.rounds[-1].mesh.widths
    middle = widths[np.searchsorted(found.rounds[-1].mesh.edges, 0.5) - 1]
    assert widths[0] < 0.2 * middle
    assert widths[-1] < 0.2 * middle
    assert max(found.rounds[-1].mesh.degrees) == 5
    assert found.solution.iterations > 0
    edges = found.solution.fractions[found.solution.breaks]
    np.testing.assert_allclose(edges, found.rounds[-1].mesh.edges, atol=ROUNDING)


def test_deterministic_and_with_the_data_of_its_start() -> None:
    start = MultipleShooting(30).build(tracker()).run(x0=[-0.4, 0.6], t0=0.7, parameters=OTHER)
    # 6 intervals: the knots of the signals are edges.
    one, other = (refine_mesh(start, solver=Collocation(6)) for _ in range(2))
    np.testing.assert_array_equal(one.solution.u, other.solution.u)
    assert one.rounds[-1].mesh == other.rounds[-1].mesh
    assert one.solution.t[0] == 0.7
    np.testing.assert_array_equal(one.solution.x0, [-0.4, 0.6])
    assert evaluate(one.solution).cost == pytest.approx(one.solution.cost, rel=CERTIFIED)


def test_says_so_where_the_rounds_are_too_few() -> None:
    found = refine_mesh(solve(rayleigh(), MultipleShooting(40)), rounds=2)
    assert found.solution.status is Status.INACCURATE
    assert "still wrong by" in found.solution.message
    assert len(found.rounds) == 2


def test_a_failing_round_ends_it() -> None:
    start = solve(braked(), MultipleShooting(20))
    found = refine_mesh(start)
    assert found.solution.status is Status.INFEASIBLE
    assert len(found.rounds) == 1


def test_what_it_does_not_see() -> None:
    """The switch of the minimum time lies in an interval whose dynamics are integrated exactly."""
    found = refine_mesh(
        solve(double_integrator_minimum_time(), MultipleShooting(40)),
        solver=Collocation(5, 3),
    )
    assert found.solution.status is Status.SOLVED
    assert len(found.rounds) == 1
    assert evaluate(found.solution).cost > 2.0 + 1e-4
    # And a state bound is kept at the points only: between them the path gains by it.
    start = solve(bryson_denham(), MultipleShooting(40))
    verdict = evaluate(refine_mesh(start, accuracy=3e-8).solution)
    assert 4.0 * (1.0 - 1e-5) < verdict.cost < 4.0 - 1e-7
    assert verdict.violation > 1e-8


@pytest.mark.parametrize("options", [{"accuracy": 0.0}, {"accuracy": np.nan}, {"rounds": 0}])
def test_bad_options(options: dict) -> None:
    with pytest.raises(ProblemError):
        refine_mesh(solve(van_der_pol(), MultipleShooting(5)), **options)


def test_refuses_discrete_time() -> None:
    with pytest.raises(UnsupportedProblem, match="discrete-time"):
        refine_mesh(solve(discrete_double_integrator(5, 0.1), MultipleShooting()))
