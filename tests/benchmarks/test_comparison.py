"""The comparison of thesis 3.2.6: the search, the claims, the figures."""

import numpy as np
import pytest

from benchmarks.cases import arm_parts, arm_scenario, comparison_cases, link_cases
from benchmarks.figures import over_horizon
from benchmarks.methods.many_kinematics import ManyKinematics
from benchmarks.methods.tuned_kinematics import candidates, instantaneous
from benchmarks.tables.comparison import comparison_claims, comparison_table
from ocp import evaluate
from tests.benchmarks.test_claims import row


def test_many_controllers_at_once_are_each_the_controller_itself():
    scenario = arm_scenario("arm-003")
    ocp = scenario.ocp("closest", form="velocity")
    chosen = candidates(scenario)[5::40]
    many = ManyKinematics.of(scenario, ocp, instantaneous(scenario, chosen[0]))
    costs, errors = many.judged(np.array([[r.v0, r.d_m, r.d_i] for r in chosen]), 0.02)
    for repulsion, cost, error in zip(chosen, costs, errors, strict=True):
        program = instantaneous(scenario, repulsion).build()
        run = program.run(scenario.theta0, duration=scenario.horizon, dt=0.02)
        assert error == pytest.approx(run.errors["path"][:-1].max(), abs=1e-12)
        assert cost == pytest.approx(evaluate(run.as_solution(ocp)).cost, rel=1e-5)


def test_a_case_knows_its_scenario():
    assert arm_parts(comparison_cases()[0]) == (arm_scenario("arm-001"), "sum")
    with pytest.raises(KeyError):
        arm_parts(link_cases()[0])


def of(solver: str, **changes):
    return row(suite="comparison", case="compare-arm-001-closest", solver=solver, **changes)


@pytest.mark.parametrize(
    ("solver", "bad"),
    [
        ("instantaneous", {"gap": -0.01}),
        ("instantaneous", {"task_drift": 0.01}),
        ("schuetz-0.1", {"gap": 1e-4}),
        ("schuetz-0.01", {"gap": 0.01}),
        ("indirect-15", {"gap": 1e-3}),
    ],
)
def test_a_claim_of_the_comparison_fails_with_its_number(solver, bad):
    good = {
        "instantaneous": of("instantaneous", gap=0.1, task_drift=1e-4),
        "schuetz-0.1": of("schuetz-0.1", gap=0.1),
        "schuetz-0.01": of("schuetz-0.01", gap=1e-4),
        "indirect-15": of("indirect-15", gap=1e-9),
    }
    assert len(claims := comparison_claims(list(good.values()))) == 3
    assert all(claim.holds for claim in claims)
    worse = {**good, solver: of(solver, **{"task_drift": 1e-4, **bad})}
    assert not all(claim.holds for claim in comparison_claims(list(worse.values())))


def test_a_table_needs_rows():
    assert comparison_table([], "sum") is None
    table = comparison_table([of("instantaneous", gap=None)], "closest")
    assert table is not None
    assert table.row_count == 1


@pytest.mark.slow
def test_the_disparity_grows_with_the_horizon_if_the_step_is_too_large():
    data = over_horizon.costs(("arm-003",), (0.5, 1.5)).columns
    large, small, sound = (
        data[f"gap, arm-003, {method} [%]"]
        for method in (over_horizon.LARGE_STEP, over_horizon.SMALL_STEP, over_horizon.SOUND)
    )
    assert large[0] < 0.1 < 10.0 < large[1]
    assert max(small) < 0.3
    assert max(sound) < 0.01
