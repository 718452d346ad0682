"""Collocation takes everything that a description in continuous time can say."""

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.cases import arm_scenario
from models.textbook import (
    bryson_denham,
    discrete_double_integrator,
    double_integrator_energy,
    double_integrator_minimum_time,
    van_der_pol,
)
from ocp import (
    MPC,
    OCP,
    Constraint,
    FlightRecorder,
    FreeTime,
    InputSource,
    Parameter,
    Plant,
    ProblemError,
    Signal,
    Solution,
    Status,
    UnsupportedProblem,
    evaluate,
    replay,
    solve,
)
from ocp.problem.run_data import RunData
from solvers import Collocation, IndirectShooting, Mesh, MultipleShooting, Schuetz, polish
from solvers.collocation.collocated_problem import CollocatedProblem
from solvers.collocation.collocation_points import Family
from solvers.collocation.mesh import CollocationGrid
from tests.mpc.problems import cart
from tests.solvers.problems import (
    OTHER,
    TRANSFER_COST,
    TRANSFER_TIME,
    changed,
    circle_start,
    ends,
    moving,
    point,
    saturated_transfer,
    timed_transfer,
    tracker,
)
from tests.solvers.test_multiple_shooting import cornered
from tests.tolerances import CERTIFIED, MINIMISER, ROUNDING

both = pytest.mark.parametrize("points", ["radau", "gauss"])

PROBLEMS: dict[str, Callable[[], OCP]] = {
    "van der Pol": van_der_pol,
    "time, parameters, signals": tracker,
    "control bounds": lambda: saturated_transfer()[0],
    "state, path, terminal inequality": cornered,
    "free time": timed_transfer,
    "minimum time": double_integrator_minimum_time,
    "manifold start": lambda: circle_start((0.9, 0.3)),
    "arm": lambda: arm_scenario("arm-002").ocp(),
    "arm, velocity form": lambda: arm_scenario("arm-002").ocp(form="velocity"),
    "arm, clearance": lambda: arm_scenario("arm-003").ocp(clearance=0.1),
}
SLOW = {name for name in PROBLEMS if name.startswith("arm")}


# Held controls on 75 intervals come within O(h^2) in cost, but for these (cost, costate):
COARSE = {
    # They leave the power limit by 0.03 between the nodes, and gain by it (0.0138 for 300).
    "state, path, terminal inequality": (5e-2, 0.3),
    # They leave the task by 0.02, and pay for it: 6.8067 for 300, 6.7909 here.
    "arm, velocity form": (1e-2, 0.05),
}


@pytest.mark.many
@both
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in PROBLEMS]
)
def test_agrees_with_multiple_shooting(name: str, points: Family) -> None:
    """6 divides 12: the knots of the tracker's signals are edges."""
    ocp = PROBLEMS[name]()
    held, solution = solve(ocp, MultipleShooting(75)), solve(ocp, Collocation(12, points=points))
    assert solution.status is Status.SOLVED, solution.message
    assert np.all(ocp.control_bounds.excess(solution.u) == 0.0)
    verdict = evaluate(solution)
    limit, limit_costate = COARSE.get(name, (1e-3, 0.02))
    assert verdict.cost == pytest.approx(evaluate(held).cost, rel=limit)
    assert solution.cost == pytest.approx(verdict.cost, rel=1e-4)
    size = 1.0 + np.abs(held.costate).max()
    np.testing.assert_allclose(solution.costate[0], held.costate[0], atol=limit_costate * size)


@both
def test_controls_never_leave_their_bounds(points: Family) -> None:
    """Between the points either, where a polynomial through bounded values would overshoot."""
    for intervals in (5, 12, 15):
        solution = solve(double_integrator_minimum_time(), Collocation(intervals, points=points))
        assert solution.status is Status.SOLVED
        u = evaluate(solution).truth.drive[1]
        assert np.abs(u).max() <= 1.0 + ROUNDING


@both
def test_data_change_without_rebuilding(points: Family) -> None:
    """A run with other data equals a fresh problem that declares them."""
    solver = Collocation(12, points=points)
    program = solver.prepare(tracker())
    first, x0, t0 = program.run(), [-0.4, 0.6], 0.7
    again = program.run(parameters=OTHER, x0=x0, t0=t0)
    declared = tracker()
    entries = tuple(
        Signal(e.name, e.symbol, OTHER[e.name], hold=e.hold)
        if isinstance(e, Signal)
        else Parameter(e.name, e.symbol, OTHER[e.name])
        for e in declared.parameters
    )
    fresh = solver.prepare(changed(declared, parameters=entries, x0=x0)).run(t0=t0)
    np.testing.assert_allclose(again.u, fresh.u, atol=CERTIFIED)
    assert (again.t[0], again.t[-1]) == (t0, t0 + 1.2)
    np.testing.assert_array_equal(again.x[0], x0)
    # 3 divides 12: the knots of the signals are edges, and everything is smooth between them.
    assert evaluate(again).cost == pytest.approx(again.cost, rel=CERTIFIED)
    np.testing.assert_array_equal(program.run().u, first.u)


@both
def test_free_final_time(points: Family) -> None:
    solution = solve(timed_transfer(), Collocation(4, 3, points=points))
    assert solution.duration == pytest.approx(TRANSFER_TIME, rel=CERTIFIED)
    assert evaluate(solution).cost == pytest.approx(TRANSFER_COST, rel=CERTIFIED)
    ocp = timed_transfer(horizon=FreeTime(guess=1.0, lower=0.5, upper=1.5))
    # T + 6/T^3 at T = 3/2: the bound is active, to the interior point's tolerance.
    bounded = solve(ocp, Collocation(4, 3, points=points))
    assert bounded.duration <= 1.5
    assert evaluate(bounded).cost == pytest.approx(1.5 + 6.0 / 1.5**3, rel=CERTIFIED)


@both
def test_minimum_time_is_exact_where_the_switch_is_an_edge(points: Family) -> None:
    solution = solve(
        double_integrator_minimum_time(), Collocation(4, 2, points=points, tolerance=1e-11)
    )
    assert evaluate(solution).cost == pytest.approx(2.0, abs=CERTIFIED)
    np.testing.assert_allclose(solution.u[:4, 0], 1.0, atol=MINIMISER)
    np.testing.assert_allclose(solution.u[4:, 0], -1.0, atol=MINIMISER)


@both
def test_manifold_start(points: Family) -> None:
    solution = solve(circle_start((0.5, 0.9)), Collocation(3, points=points))
    np.testing.assert_allclose(solution.x[0], [1.0, 0.0], atol=MINIMISER)
    assert evaluate(solution).cost == pytest.approx(0.25, rel=CERTIFIED)
    np.testing.assert_allclose(solution.costate[0], [-0.5, 0.0], atol=MINIMISER)


def test_initial_inequality_and_a_wall_at_a_free_start() -> None:
    """Start at most 1 away from 0, end at 3: from 1, with u = 2; with a wall at 0.5 from there."""
    gate: Callable[..., Any] = lambda x, u: (  # noqa: E731
        Constraint("gate", x, -1.0, 1.0, at="initial"),
        *ends(3.0)(x, u),
    )
    assert solve(point(constraints=gate), Collocation(3)).cost == pytest.approx(4.0, rel=MINIMISER)
    walled = point(
        constraints=lambda x, u: (*gate(x, u), Constraint("wall", -x, upper=-1.5)), x0=2.0
    )
    solution = solve(walled, Collocation(3))
    assert solution.status is Status.INFEASIBLE
    assert "'wall'" in solution.message or "'gate'" in solution.message
    # A wall at 0.5, 0.8 from the end: the start would rather be nearer to 3.
    behind = point(
        constraints=lambda x, u: (*gate(x, u), Constraint("wall", x * (3.0 - x), upper=1.25))
    )
    start = solve(behind, Collocation(3)).x[0, 0]
    assert start * (3.0 - start) <= 1.25 + MINIMISER


@both
def test_what_holds_where(points: Family) -> None:
    """State bounds and path constraints at the points: with Radau ends of intervals, too."""
    ocp = bryson_denham()
    program = Collocation(7, points=points).prepare(ocp)
    grid, solution = program.transcription.grid, program.run()
    assert set(grid.edge_nodes[1:]) <= set(grid.point_nodes) or points == "gauss"
    assert not set(grid.edge_nodes) & set(grid.point_nodes) or points == "radau"
    assert ocp.state_bounds.excess(solution.x[grid.point_nodes]).max() == 0.0
    # Between the points it is violated, and the referee says so.
    assert 1e-7 < evaluate(solution).violation < 1e-3


# -- meshes -----------------------------------------------------------------------------

meshes = st.lists(st.tuples(st.floats(0.1, 1.0), st.integers(2, 5)), min_size=1, max_size=4)


@pytest.mark.slow
@given(meshes, st.sampled_from(["radau", "gauss"]))
@settings(max_examples=10, deadline=None)
def test_energy_is_exact_on_any_mesh(cells: list[tuple[float, int]], points: Family) -> None:
    """A line in u and a cubic in x: exact from degree 3 on."""
    widths = np.array([width for width, _ in cells])
    edges = np.append(0.0, np.cumsum(widths) / widths.sum())
    edges[-1] = 1.0
    mesh = Mesh(tuple(edges), tuple(d for _, d in cells))
    solution = solve(double_integrator_energy(), Collocation(points=points, mesh=mesh))
    assert len(solution.u) == len(cells) * max(mesh.degrees)
    if min(mesh.degrees) > 2:
        assert solution.status is Status.SOLVED
        assert evaluate(solution).cost == pytest.approx(6.0, rel=CERTIFIED)
        np.testing.assert_allclose(
            solution.costate, np.stack([0 * solution.t - 12.0, 12 * solution.t - 6.0], 1), atol=1e-6
        )


def test_a_mesh_where_it_matters() -> None:
    """Bryson-Denham with edges at the ends of the arc is exact; 5 equal intervals are not."""
    mesh = Mesh((0.0, 1 / 3, 2 / 3, 1.0), (3, 3, 3))
    exact = solve(bryson_denham(), Collocation(mesh=mesh, tolerance=1e-11)).cost
    assert exact == pytest.approx(4.0, rel=CERTIFIED)
    assert solve(bryson_denham(), Collocation(5, 3)).cost != pytest.approx(4.0, rel=1e-4)


# -- starts -----------------------------------------------------------------------------


@both
def test_any_solution_starts_it_and_it_starts_any(points: Family) -> None:
    ocp = van_der_pol()
    program = Collocation(10, points=points).prepare(ocp)
    cold = program.run()
    starts: tuple[Solution, ...] = (
        solve(ocp, Schuetz.sound(intervals=30)),
        solve(ocp, IndirectShooting()),
        solve(ocp, MultipleShooting(20)),
        solve(ocp, Collocation(4, 2)),
    )
    for start in starts:
        warm = program.run(guess=start)
        assert warm.status is Status.SOLVED
        assert warm.cost == pytest.approx(cold.cost, rel=CERTIFIED)
        assert warm.iterations <= cold.iterations
    assert solve(ocp, IndirectShooting(segments=15), guess=cold).status.is_success
    assert solve(ocp, MultipleShooting(40), guess=cold).status is Status.SOLVED
    # A reached optimum goes down no further: that is no failure of the start.
    gradient = solve(ocp, Schuetz.sound(intervals=100), guess=cold)
    assert gradient.cost == pytest.approx(cold.cost, rel=1e-3)


@both
def test_a_maximum_is_left(points: Family) -> None:
    """u = 0 is stationary, but J = x1^2 - 3 x1^2 + x1^4 is least at x1 = 1 or -1, with -1."""
    ocp = point(terminal_cost=lambda x, u: -3.0 * x**2 + x**4)
    solution = solve(ocp, Collocation(5, points=points))
    assert abs(solution.x[-1, 0]) == pytest.approx(1.0, abs=MINIMISER)
    assert evaluate(solution).cost == pytest.approx(-1.0, rel=CERTIFIED)


def test_a_start_that_blows_up_is_replaced() -> None:
    """The roll-out of u = 0 leaves every bound: the first iterate then stays at the start."""
    ocp = moving(lambda x, u: x**3 + u, x0=1.2, constraints=ends(1.0))
    program = Collocation(20).prepare(ocp)
    first = program._first_iterate(RunData(ocp.start(), 0.0, ocp.parameter_values()), None)
    assert np.abs(first.x).max() == 1.2
    assert program.run().status is Status.SOLVED


def test_deterministic() -> None:
    ocp = arm_scenario("arm-002").ocp()
    one, other = (solve(ocp, Collocation(10)) for _ in range(2))
    np.testing.assert_array_equal(one.x, other.x)
    np.testing.assert_array_equal(one.u, other.u)
    np.testing.assert_array_equal(one.costate, other.costate)
    assert (one.cost, one.iterations, one.work) == (other.cost, other.iterations, other.work)


def test_a_solution_on_disk_is_the_same(tmp_path: Path) -> None:
    solution = solve(tracker(), Collocation(6))
    back = Solution.load(solution.save(tmp_path / "kept"), solution.problem)
    assert evaluate(back).cost == evaluate(solution).cost
    assert polish(solve(van_der_pol(), Collocation(6))).status is Status.SOLVED


def test_stationarity_of_an_optimum_by_the_referee() -> None:
    verdict = evaluate(solve(van_der_pol(), Collocation(20, 5, points="gauss")))
    assert verdict.stationarity is not None
    assert verdict.stationarity <= CERTIFIED


@pytest.mark.slow
def test_plans_of_a_loop_replay_to_the_last_bit(tmp_path: Path) -> None:
    """Shifted, rehearsed and recorded as the polynomials they are."""
    mpc = MPC(ocp=cart(), solver=Collocation(5, 3), dt=0.1)
    with FlightRecorder(mpc, tmp_path / "flight") as recorder:
        rollout = mpc.run(Plant(ocp=cart()), [1.0, 0.0], 0.5, watch=recorder.watch)
    assert all(source is InputSource.OPTIMAL for source in rollout.sources)
    assert all(replay(mpc, tmp_path / "flight", k).is_exact for k in range(5))


# -- refusals ---------------------------------------------------------------------------


def test_refuses_discrete_time_by_name() -> None:
    with pytest.raises(UnsupportedProblem, match=r"no discrete-time model \('double integrator'\)"):
        Collocation().prepare(discrete_double_integrator(5, 0.1))


@pytest.mark.parametrize(
    "make",
    [
        lambda: Collocation(0),
        lambda: Collocation(degree=1),
        lambda: Collocation(degree=6),
        lambda: Collocation(degree=2.5),  # pyright: ignore[reportArgumentType]
        lambda: Collocation(points="lobatto"),  # pyright: ignore[reportArgumentType]
        lambda: Collocation(mesh=(0.0, 1.0)),  # pyright: ignore[reportArgumentType]
        lambda: Collocation(tolerance=0.0),
        lambda: Collocation(accuracy=np.nan),
        lambda: Collocation(max_iterations=0),
    ],
)
def test_bad_options(make: Callable[[], object]) -> None:
    with pytest.raises(ProblemError):
        make()


def test_the_program_has_no_more_entries_than_it_needs() -> None:
    """One interval's rows touch one interval's unknowns: the Jacobian grows linearly."""
    counts = []
    for intervals in (10, 20):
        program = Collocation(intervals, 3).prepare(van_der_pol()).transcription.program
        counts.append(ca.jacobian_sparsity(program["g"], program["x"]).nnz())
    assert counts[1] <= 2 * counts[0]


def test_no_dense_matrix_of_all_intervals():
    intervals, degree = 400, 3
    problem = CollocatedProblem(van_der_pol(), CollocationGrid.of(Mesh.uniform(400, 3), "radau"))
    tracemalloc.start()
    matrices = problem._matrices
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    most = [intervals * degree, intervals * degree**2] * 2
    assert all(m.nnz() <= limit for m, limit in zip(matrices, most, strict=True))
    assert peak < 0.2 * 8 * (intervals * degree) ** 2
