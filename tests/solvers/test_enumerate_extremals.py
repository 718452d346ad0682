"""Enumeration of extremals: what must be found, what is said of it, and what is refused."""

from itertools import pairwise

import numpy as np
import pytest

from benchmarks.cases import arm_cases, arm_scenario
from ocp import Constraint, ProblemError, Status, UnsupportedProblem, evaluate, solve
from solvers import IndirectShooting, MultipleShooting, enumerate_extremals, multistart, polish
from tests.solvers.problems import changed
from tests.solvers.test_reverse_shooting import SAME_COST, bare
from tests.tolerances import GAP, RESIDUAL


@pytest.mark.slow
def test_without_obstacle_there_is_one_extremal() -> None:
    ocp = bare()
    found = enumerate_extremals(ocp)
    (extremal,) = found.minima
    assert len(found.solutions) == 1
    assert (found.unresolved, found.lost) == (0, 0)
    # Every point of the scan is a motion integrated back; Newton's steps are counted beside it.
    assert found.work.rollouts > len(found.scans[0].arc) + extremal.work.rollouts
    assert found.iterations == extremal.iterations
    assert extremal.residual <= RESIDUAL
    direct = evaluate(solve(ocp, MultipleShooting(150))).cost
    assert abs(found.costs[0] - direct) <= SAME_COST * (1.0 + direct)


@pytest.mark.slow
def test_a_free_start_has_minima_and_maxima_in_turn() -> None:
    found = enumerate_extremals(bare(free_start=True), keep=None)
    (scan,) = found.scans
    wrapped = scan.curve.manifold.periods.wrapped
    away = [np.linalg.norm(wrapped(scan.ends - s.x[-1]), axis=1) for s in found.solutions]
    order = np.argsort([int(np.argmin(distance)) for distance in away])
    kinds = [found.solutions[i].status is Status.SOLVED for i in order]
    assert len(kinds) % 2 == 0
    assert all(a != b for a, b in pairwise(kinds))
    # The cheapest is where the cost curve has its minimum (Fig. 3.9).
    assert found.costs[0] <= scan.costs.min()
    assert found.costs[0] >= scan.costs.min() - 1e-3


@pytest.mark.slow
def test_the_scan_is_the_same_every_time_and_fine_where_it_says_so() -> None:
    one, other = (enumerate_extremals(bare(), keep=1) for _ in range(2))
    np.testing.assert_array_equal(one.scans[0].starts, other.scans[0].starts)
    assert one.scans[0].distances.max() <= 0.3


@pytest.mark.slow
def test_few_points_are_admitted() -> None:
    found = enumerate_extremals(arm_scenario("arm-001").ocp("sum"), points=100, keep=1)
    assert found.unresolved > 0


@pytest.mark.over_library
@pytest.mark.slow
@pytest.mark.parametrize("name", ["arm-001-sum", "arm-009-sum", "arm-015-sum", "arm-030-sum"])
def test_the_reference_is_found(name: str) -> None:
    # arm-009: a start moves by 1 rad while its end moves by 1e-4 rad.
    (case,) = [case for case in arm_cases() if case.name == name]
    found = enumerate_extremals(case.build(), keep=4)
    gap = case.gap(found.costs[0])
    assert gap is not None
    assert abs(gap) <= GAP["polish"]
    assert (np.diff(found.costs) >= 0.0).all()


@pytest.mark.slow
def test_every_minimum_of_a_multistart_is_among_them() -> None:
    ocp = arm_scenario("arm-001").ocp("sum")
    found = enumerate_extremals(ocp)
    assert len(found.solutions) == 11
    minima = [evaluate(solution).cost for solution in found.minima]
    for optimum in multistart(ocp, MultipleShooting(75), starts=6, seed=1):
        exact = evaluate(polish(optimum.solution)).cost
        assert min(abs(cost - exact) for cost in minima) <= SAME_COST * (1.0 + exact)


@pytest.mark.slow
def test_a_free_start_with_obstacle_agrees_with_direct_multiple_shooting() -> None:
    ocp = arm_scenario("arm-001").ocp("sum", free_start=True)
    found = enumerate_extremals(ocp, keep=2)
    best = found.solutions[0]
    direct = solve(ocp, MultipleShooting(300), guess=best).or_raise()
    assert abs(evaluate(direct).cost - found.costs[0]) <= SAME_COST * (1.0 + found.costs[0])
    assert np.abs(direct.x[[0, -1]] - best.x[[0, -1]]).max() <= 1e-4


def test_refuses_what_it_cannot_enumerate() -> None:
    four = bare(lengths=(0.8,) * 4, theta0=(1.2, -0.9, -0.8, -0.6))
    with pytest.raises(UnsupportedProblem, match="has 2 dimensions"):
        enumerate_extremals(four)
    ocp = bare()
    error = ocp.invariants[0]
    ended = changed(
        ocp, constraints=(Constraint("end", error.expression, 0.0, 0.0, at="terminal"),)
    )
    with pytest.raises(UnsupportedProblem, match="terminal constraint 'end'"):
        enumerate_extremals(ended)
    with pytest.raises(ProblemError, match="the start misses 'task error'"):
        enumerate_extremals(ocp, x0=[1.0, -1.5, -1.6])
    with pytest.raises(ProblemError, match="spacing"):
        enumerate_extremals(ocp, spacing=0.0)
    with pytest.raises(ProblemError, match="keep"):
        enumerate_extremals(ocp, keep=0)


@pytest.mark.slow
def test_roots_that_newton_does_not_confirm_are_counted() -> None:
    hasty = IndirectShooting(segments=15, tolerance=1e-300)
    found = enumerate_extremals(bare(), solver=hasty)
    assert (len(found.solutions), found.lost) == (0, 1)
    assert found.costs.shape == (0,)


@pytest.mark.slow
def test_steps_are_halved_until_the_cost_holds_still():
    # From few steps the same extremals as from many.
    ocp = bare()
    coarse, fine = (
        enumerate_extremals(ocp, solver=IndirectShooting(segments=15, steps=steps))
        for steps in (30, 300)
    )
    np.testing.assert_allclose(coarse.costs[0], fine.costs[0], rtol=1e-7)
    again = polish(coarse.solutions[0])
    assert again.status is coarse.solutions[0].status
