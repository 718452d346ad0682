"""Hard clearances on the arm: every method, to the micrometre, by the referee."""

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import all_cases, arm_scenario, required_clearance, soft_optimum
from benchmarks.claims.clearance import clearance_claims
from benchmarks.claims.every import claims_of
from benchmarks.methods.clearance import clearance_methods
from benchmarks.methods.method import Settings
from benchmarks.sweep.row import Row
from models import link_distances, seven_links
from ocp import Solver, Status, evaluate, solve
from solvers import AugmentedLagrangian, BetweenNodes, MultipleShooting, Schuetz, polish

KEPT = 1e-6
SAME_COST = 1e-3
FEASIBLE = ("arm-003", "arm-021", "arm-035")
METHODS = [m for m in clearance_methods() if "clearance" in m.suites]


def row_of(name: str, method) -> Row:
    case = next(case for case in all_cases() if case.name == f"{name}-beyond")
    return Row.of(case, method, Settings(), method.run(case, Settings()))


@pytest.mark.slow
@pytest.mark.parametrize("name", FEASIBLE)
def test_clearance_and_path_are_kept_by_all(name: str) -> None:
    rows = [row_of(name, method) for method in METHODS]
    for row in rows:
        assert row.solved, f"{row.solver}: {row.status} {row.message}"
        assert max(row.violation or 0.0, row.task_drift or 0.0) <= KEPT
    costs = [row.cost for row in rows if row.cost is not None]
    assert max(costs) / min(costs) - 1.0 <= SAME_COST
    assert all(claim.holds for claim in claims_of(rows))


@pytest.mark.many
@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
def test_a_start_too_close_is_infeasible(method) -> None:
    row = row_of("arm-001", method)
    assert row.status == "INFEASIBLE"
    assert "'clearance' is violated by 0.05 at t = 0 s" in row.message


@pytest.mark.slow
@pytest.mark.parametrize(
    "solver",
    [BetweenNodes(MultipleShooting(40)), AugmentedLagrangian(Schuetz.sound(), penalty=1e4)],
    ids=["direct", "lagrangian"],
)
def test_a_path_through_the_disc_is_infeasible(solver: Solver) -> None:
    scenario = arm_scenario("arm-034")
    ocp = scenario.ocp(weight=0.0, clearance=scenario.radius)
    solution = solve(ocp, solver, guess=soft_optimum("arm-034"))
    assert solution.status is Status.INFEASIBLE
    # The end effector's own path leaves 0.1059 m of the 0.2 m: 0.0941 m are missing.
    assert scenario.radius - scenario.path_clearance == pytest.approx(0.0941, abs=1e-4)
    assert "'clearance' is violated by 0.09" in solution.message
    assert "at t = 0.7" in solution.message


@pytest.mark.parametrize("name", ["arm-001", "arm-003", "arm-021"])
def test_required_clearance_is_that_of_the_soft_optimum_and_more(name: str) -> None:
    scenario, truth = arm_scenario(name), evaluate(soft_optimum(name)).truth
    theta = ca.SX.sym("theta", 3)
    distances = link_distances(scenario.arm, theta, scenario.disc)
    closest = ca.Function("closest", [theta], [ca.mmin(distances)])
    found = float(np.array(closest.map(len(truth.t))(truth.x.T)).min()) + 0.05
    assert required_clearance(name, "beyond") == pytest.approx(found, abs=1e-3)


@pytest.mark.slow
def test_seven_links_three_discs_and_limits() -> None:
    """Active clearance and joint limit: direct and augmented Lagrangian from the same start."""
    start = solve(seven_links(clearance=None, joint_bounds=None), MultipleShooting(75))
    assert evaluate(start.with_(problem=seven_links())).violation > 1e-3
    direct = solve(seven_links(), BetweenNodes(MultipleShooting(75)), guess=start)
    solver = AugmentedLagrangian(Schuetz.sound(), penalty=1e3)
    multipliers = solve(seven_links(), solver, guess=start)
    verdicts = [evaluate(s) for s in (direct, multipliers)]
    assert direct.status.is_success
    assert multipliers.status.is_success
    assert all(max(v.violation, v.task_drift) <= KEPT for v in verdicts)
    assert verdicts[0].cost == pytest.approx(verdicts[1].cost, rel=SAME_COST)
    assert np.min(direct.x[:, 2]) == pytest.approx(-0.57, abs=3e-3), "the limit does not act"


@pytest.mark.slow
def test_seven_links_polished_where_no_constraint_is_active() -> None:
    """A soft cost keeps the arm clear: direct, augmented Lagrangian and extremal agree."""
    free = seven_links(gain=20.0, clearance=None, joint_bounds=None)
    wide = seven_links(gain=20.0, clearance=0.07, joint_bounds=None)
    start = solve(seven_links(clearance=None, joint_bounds=None), MultipleShooting(75))
    direct = solve(wide, BetweenNodes(MultipleShooting(75)), guess=start)
    multipliers = solve(wide, AugmentedLagrangian(Schuetz.sound()), guess=start)
    extremal = polish(solve(free, MultipleShooting(75), guess=start))
    assert extremal.status is Status.SOLVED
    costs = [evaluate(s).cost for s in (direct, multipliers, extremal)]
    assert max(costs) / min(costs) - 1.0 <= SAME_COST
    as_hard = extremal.with_(problem=wide, control_kind="linear")
    assert evaluate(as_hard).violation <= KEPT


def test_claims_need_rows_of_the_suite() -> None:
    assert clearance_claims([]) == ()
