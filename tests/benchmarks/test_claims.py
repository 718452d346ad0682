"""The claims: they fail when the numbers do."""

from dataclasses import replace

import pytest

from benchmarks.cases import arm_cases
from benchmarks.claims.every import below_reference, claims_of
from benchmarks.sweep.row import Row
from benchmarks.tables.by_method import table_of
from benchmarks.tables.extremes import extremes_table
from benchmarks.tables.jacobians import jacobian_table

CASE = arm_cases()[0]


def row(**changes) -> Row:
    """A row that bears every claim out."""
    good = Row(
        suite="arm", case=CASE.name, solver="direct-75", settings="", starts=1, seed=0,
        status="SOLVED", message="", solved=True, optimum=True, cost=1.0, reference=1.0, lower=1.0,
        gap=1e-4, local_gap=1e-9, violation=0.0, worst="", stationarity=0.0, task_drift=0.0,
        residual=1e-12, iterations=2, rollouts=1, jacobians=1, factorisations=1,
        build_time=0.1, solve_time=0.1, states=3, controls=1, intervals=75, when="",
        versions={}, machine={},
    )  # fmt: skip
    return replace(good, **changes)


@pytest.mark.parametrize(
    ("solver", "bad"),
    [
        ("direct-75", {"gap": 3e-3}),
        ("direct-75", {"solved": False}),
        ("polish", {"gap": 2e-6}),
        ("polish", {"residual": 1e-9, "gap": 0.0}),
        ("polish", {"iterations": 4, "gap": 0.0}),
        ("polish", {"status": "STATIONARY", "gap": 0.0}),
        ("extremals", {"gap": 2e-6}),
        ("extremals", {"solved": False}),
        ("schuetz-sound", {"local_gap": 2e-3}),
        ("indirect-15", {"optimum": False}),
    ],
)
def test_a_claim_fails_with_its_number(solver, bad):
    good = row(solver=solver, gap=1e-9)
    assert all(claim.holds for claim in claims_of([good]))
    assert not all(claim.holds for claim in claims_of([replace(good, **bad)]))


def test_refinement_is_judged_case_by_case():
    coarse, fine = row(gap=1e-4), row(solver="direct-150", gap=2.5e-5)
    assert all(claim.holds for claim in claims_of([coarse, fine]))
    assert not all(claim.holds for claim in claims_of([coarse, replace(fine, gap=5e-5)]))


def test_a_cost_below_its_reference_disproves_it():
    assert below_reference([row(cost=1.0 - 2e-6)])
    assert not below_reference([row(cost=1.0 - 0.5e-6)])
    # Within the interval of the reference it is no disproof.
    assert not below_reference([row(cost=1.0 - 2e-6, lower=1.0 - 1e-5)])
    assert not below_reference([row(cost=1.0 - 2e-6, lower=None)])
    # A method may not stand behind it, the referee does.
    assert below_reference([row(cost=1.0 - 2e-6, solved=False, status="SMALL_DECREASE")])
    assert not below_reference([row(cost=1.0 - 2e-6, violation=1e-5)])


def test_tables_have_a_line_for_each_method_and_survive_failures():
    failed = row(
        solver="shooting", solved=False, optimum=False, gap=None, cost=None, violation=None
    )
    assert table_of([row(), failed], "arm").row_count == 2
    shooting = extremes_table([failed, row(solver="shooting")])
    assert shooting is not None
    assert shooting.row_count == 1
    assert extremes_table([row()]) is None
    pair = [row(solver="shooting"), row(solver="shooting-fd", solved=False)]
    jacobians = jacobian_table(pair)
    assert jacobians is not None
    assert jacobians.row_count == 1
    assert jacobian_table([row()]) is None
