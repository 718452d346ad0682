from time import perf_counter

import casadi as ca
import numpy as np
import pytest

from ocp import (
    OCP,
    Box,
    Constraint,
    Model,
    ProblemError,
    Status,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import Axis, GridDP, MultipleShooting
from solvers.tabular.columns import Columns
from solvers.tabular.state_grid import StateGrid
from tests.linear_dp.problems import line, scalar, scalar_cost, tracking, unstable_mass, walk
from tests.tolerances import ROUNDING


def test_scalar_against_the_riccati_recursion():
    solution = solve(scalar(), GridDP(states=201, controls=81))
    true_error = abs(evaluate(solution).cost - scalar_cost(5))
    assert solution.status is Status.SOLVED
    assert true_error <= solution.residual <= 0.01 * solution.cost
    # The value function itself: interpolation overestimates it, by less than the estimate.
    _, coarse, fine = solution.history["value"]
    assert 0.0 <= fine - scalar_cost(5) <= solution.residual
    assert coarse > fine


def test_error_falls_with_the_square_of_the_cell():
    errors = []
    for n in (41, 81, 161):
        table = GridDP(states=n, controls=81).prepare(scalar()).tabulate()
        x = table.grid.axes[0].values
        near = np.abs(x) <= 1.0
        errors.append(np.mean(table.field[0] - scalar_cost(5) * x**2, where=near))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    # The kinks of the interpolation move with the grid: the order is no smooth number.
    assert np.all((orders > 1.5) & (orders < 2.5))


@pytest.mark.slow
def test_unstable_mass_against_multiple_shooting():
    grid = GridDP(states=(161, Axis(-6.0, 6.0, 161)), controls=61).build(unstable_mass())
    direct = MultipleShooting().build(unstable_mass())
    for x0 in ((1.0, 0.0), (-1.5, 3.0), (1.9, 0.5)):
        reference, solution = direct.run(x0=x0).or_raise(), grid.run(x0=x0)
        verdict, optimum = evaluate(solution), evaluate(reference).cost
        assert solution.status is Status.SOLVED
        assert verdict.violation <= 1e-9 * 40.0
        assert 0.0 <= verdict.cost - optimum <= solution.residual <= 0.01 * optimum
        assert abs(solution.history["value"][-1] - optimum) <= solution.residual
        # Differences on a grid of 161: two digits, relative to the largest.
        scale = np.abs(reference.costate).max()
        assert np.abs(solution.costate - reference.costate).max() <= 0.02 * scale


def test_reachable_sets_known_by_hand():
    # After j more steps of at most 1 the set is abs(x) <= 1 + j; every number is on the grid.
    program = GridDP(states=25, controls=9).prepare(walk())
    table = program.tabulate()
    x = table.grid.axes[0].values
    for k in range(4):
        np.testing.assert_array_equal(table.reachable[k], np.abs(x) <= 1.0 + (3 - k))


def test_a_start_that_cannot_reach_the_terminal_set():
    program = GridDP(states=25, controls=9).build(walk())
    assert program.run(x0=[4.0]).status is Status.SOLVED
    failed = program.run(x0=[4.5])
    assert failed.status is Status.INFEASIBLE
    assert "'home' is out of reach" in failed.message
    assert "step 0" in failed.message
    assert failed.cost == np.inf


def test_a_start_that_cannot_keep_its_bounds():
    # The mass at 1.9 with 8 m/s passes the bound at 2 in 13 ms, whatever is done.
    grid = GridDP(states=(41, Axis(-9.0, 9.0, 41)), controls=11)
    solution = solve(unstable_mass(x0=[1.9, 8.0]), grid)
    assert solution.status is Status.INFEASIBLE
    assert "step 0" in solution.message
    assert "x_0" in solution.message


def test_path_constraints_hold_from_the_first_node_on():
    model = line("walk", 1.0)
    fence = Constraint("fence", (model.x - 3.0) ** 2, lower=1.0)
    speed = Constraint("speed", model.u + 0.0 * model.x, upper=0.5)
    problem = walk(model=model, constraints=(fence, speed), running_cost=(model.x - 1.5) ** 2)
    solution = solve(problem, GridDP(states=121, controls=41))
    assert solution.x0[0] == 2.0
    assert evaluate(solution).violation <= 1e-8
    assert solution.u.max() <= 0.5 + 1e-8
    inside = solve(problem, MultipleShooting()).or_raise()
    assert abs(inside.cost - solution.cost) <= solution.residual + 1e-6


def test_a_fence_that_cannot_be_left_is_named():
    model = line("walk", 1.0)
    fence = Constraint("fence", model.x, lower=4.0)
    failed = solve(walk(model=model, constraints=(fence,)), GridDP(states=25, controls=9))
    assert failed.status is Status.INFEASIBLE
    assert "'fence'" in failed.message


def test_time_and_signals():
    problem = tracking()
    direct = MultipleShooting(intervals=12).build(problem).run(t0=0.7).or_raise()
    program = GridDP(states=201, controls=61, intervals=12).build(problem)
    solution = program.run(t0=0.7)
    assert solution.status is Status.SOLVED
    assert 0.0 <= solution.cost - direct.cost + 1e-8 <= solution.residual
    other = program.run(t0=0.7, parameters={"w": np.zeros(7)})
    assert other.cost < 0.5 * solution.cost


def test_the_global_one_of_two_minima():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    two_wells = (x**2 - 1.0) ** 2 - 0.3 * x
    problem = OCP(
        name="two wells",
        model=Model(name="walk", x=x, u=u, f=u),
        x0=-0.1,
        horizon=3.0,
        running_cost=u**2 / 4,
        terminal_cost=4 * two_wells,
        state_bounds=Box(-2.0, 2.0),
        control_bounds=Box(-2.0, 2.0),
    )
    solution = solve(problem, GridDP(states=201, controls=41, intervals=10))
    assert solution.x[-1, 0] > 0.9
    assert solution.status is Status.SOLVED


def test_a_kinked_cost_keeps_to_the_grid_of_controls():
    model = line("scalar", 0.9)
    cost = ca.fabs(model.x) + ca.fabs(model.u)
    problem = scalar(model=model, running_cost=cost, terminal_cost=ca.fabs(model.x), smoothness=0)
    solution = solve(problem, GridDP(states=101, controls=41))
    assert np.abs(solution.u * 10 - np.round(solution.u * 10)).max() <= ROUNDING


@pytest.mark.slow
def test_two_controls_and_three_states():
    x, u = ca.SX.sym("x", 3), ca.SX.sym("u", 2)
    f = ca.vertcat(0.5 * x[0] + u[0], 0.5 * x[1] + u[1], 0.5 * x[2] + x[0] * x[1])
    problem = OCP(
        name="three",
        model=Model(name="three", x=x, u=u, f=f, dt=1.0),
        x0=[0.5, -0.5, 0.5],
        horizon=3,
        running_cost=ca.sumsqr(x) + ca.sumsqr(u),
        terminal_cost=ca.sumsqr(x),
        state_bounds=Box(-1.0, 1.0),
        control_bounds=Box(-1.0, 1.0),
    )
    direct = solve(problem, MultipleShooting()).or_raise()
    solution = solve(problem, GridDP(states=21, controls=11))
    assert 0.0 <= solution.cost - direct.cost + 1e-8 <= solution.residual


def test_terminal_equations_need_slack():
    model = line("walk", 1.0)
    end = Constraint("end", model.x, 1.0, 1.0, at="terminal")
    problem = walk(model=model, constraints=(end,))
    with pytest.raises(UnsupportedProblem, match=r"'end' is an equation.*terminal_slack"):
        GridDP().build(problem)
    solution = solve(problem, GridDP(states=241, controls=41, terminal_slack=0.1))
    # 3 steps of 1/3: cost 1/3, less what the slack saves.
    assert solution.status is Status.SOLVED
    assert 0.9**2 / 3 - 1e-9 <= solution.cost <= 1 / 3 + 1e-9


def test_an_infinite_corner_counts_only_with_a_weight():
    grid = StateGrid((Axis(0.0, 2.0, 3), Axis(0.0, 2.0, 3)))
    value = np.zeros(9)
    value[8] = np.inf
    points = np.array(
        [[1.0, 1.0], [1.0, 2.0], [1.5, 1.5], [2.0, 2.0], [2.0 + 1e-12, 1.0], [3.0, 1]]
    )
    matrix, inside = grid.interpolation(points)
    assert list(inside) == [True, True, True, True, True, False]
    np.testing.assert_array_equal(np.isfinite(matrix @ value), [1, 1, 0, 0, 1, 1])
    linear = 2.0 * grid.points[:, 0] - grid.points[:, 1]
    np.testing.assert_allclose((matrix @ linear)[:4], 2 * points[:4, 0] - points[:4, 1])
    np.testing.assert_allclose(grid.slopes(linear), np.tile([2.0, -1.0], (9, 1)))
    assert np.isfinite(grid.slopes(value)).all()


def test_a_table_is_kept_until_the_data_change():
    program = GridDP(states=51, controls=21).build(scalar())
    first, second = program.run(), program.run(x0=[0.5])
    assert second.work.rollouts < first.work.rollouts / 10
    assert second.cost < first.cost


def test_a_grid_that_is_too_coarse_says_so():
    solution = solve(unstable_mass(50), GridDP(states=(21, Axis(-6.0, 6.0, 21)), controls=11))
    assert solution.status in (Status.INACCURATE, Status.INFEASIBLE)
    assert "grid" in solution.message


def test_refusals():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    model = Model(name="walk", x=x, u=u, f=u)
    given = {"name": "p", "model": model, "x0": 0.0, "running_cost": 1 + u**2}
    path = OCP(**given, horizon=1.0, constraints=(Constraint("c", x + u, 0.0, 0.0),))
    with pytest.raises(UnsupportedProblem, match="path constraint 'c' is an equation"):
        GridDP().build(path)
    with pytest.raises(ProblemError, match=r"states of 'x'.*Axis\(lower, upper, 101\)"):
        GridDP().build(OCP(**given, horizon=1.0))
    with pytest.raises(ProblemError, match=r"controls of 'u'.*Axis"):
        GridDP(states=(Axis(0.0, 1.0, 11),)).build(OCP(**given, horizon=1.0))
    with pytest.raises(ProblemError, match="no number of points"):
        GridDP(states=4.5).build(scalar())  # pyright: ignore[reportArgumentType]
    with pytest.raises(ProblemError, match=r"controls of 'u'.*nothing to grid"):
        GridDP().build(scalar(control_bounds=Box(1.0, 1.0)))
    with pytest.raises(ProblemError, match="2 entries for 1"):
        GridDP(states=(11, 11)).build(scalar())
    with pytest.raises(ProblemError, match="outside"):
        GridDP(states=(Axis(-9.0, 9.0, 11),)).build(scalar())
    with pytest.raises(UnsupportedProblem, match=r"take .* GB, more than memory"):
        GridDP(states=(2001, Axis(-8.0, 8.0, 2001)), controls=81).build(unstable_mass())
    narrow = GridDP(states=(Axis(-0.5, 0.5, 11),)).build(scalar())
    with pytest.raises(ProblemError, match="outside the grid"):
        narrow.run()


@pytest.mark.parametrize("bad", [{"intervals": 0}, {"terminal_slack": -1.0}, {"accuracy": np.nan}])
def test_bad_options(bad):
    with pytest.raises(ProblemError):
        GridDP(**bad)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 5), (0.0, np.inf, 5), (0.0, 1.0, 2)])
def test_bad_axes(axis):
    with pytest.raises(ProblemError, match="axis"):
        Axis(*axis)


@pytest.mark.slow
def test_201_by_201_points_81_controls_50_stages_take_seconds():
    program = GridDP(states=(201, Axis(-5.0, 5.0, 201)), controls=81).build(unstable_mass(50))
    started = perf_counter()
    solution = program.run()
    assert perf_counter() - started < 60.0
    assert solution.residual <= 0.01 * solution.cost


def test_no_points_have_no_values():
    x = ca.SX.sym("x", 2)
    function = Columns(ca.Function("f", [x], [ca.vertcat(x, ca.sumsqr(x))]), 1)
    assert function([np.empty((0, 2))], []).shape == (0, 3)
    np.testing.assert_allclose(function([np.ones((1, 2))], []), [[1.0, 1.0, 2.0]])
