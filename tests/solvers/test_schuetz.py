"""Schuetz' method: Algorithm 2's terminations and climb, its gradient, the sound version."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from models.textbook import (
    bryson_denham,
    discrete_double_integrator,
    double_integrator_energy,
    van_der_pol,
)
from ocp import (
    OCP,
    RK4,
    Box,
    Euler,
    Guess,
    ProblemError,
    Solution,
    Status,
    UnsupportedProblem,
    evaluate,
    solve,
)
from ocp.problem.run_data import RunData
from solvers import Armijo, FixedStep, MultipleShooting, Schuetz
from tests.ocp.differences import gradient
from tests.solvers.problems import OTHER, changed, circle_start, point, timed_transfer, tracker
from tests.tolerances import CERTIFIED, DERIVATIVE, GAP, ORDER, ROUNDING, SAME_PROGRAM


def history(solution: Solution) -> np.ndarray:
    return solution.history["cost"]


# -- Algorithm 2 ----------------------------------------------------------------------


def test_small_decrease() -> None:
    """The second test stops at the first decrease below epsilon, and not earlier."""
    epsilon = 1e-4
    solution = solve(arm_scenario("arm-001").ocp(), Schuetz(step=FixedStep(0.01), decrease=epsilon))
    assert solution.status is Status.SMALL_DECREASE
    assert not solution.status.is_success
    relative = -np.diff(history(solution)) / history(solution)[:-1]
    assert np.all(relative[:-1] >= epsilon)
    assert 0.0 <= relative[-1] < epsilon


@pytest.mark.parametrize(("alpha", "best"), [(0.1, 5), (0.2, 0)])
def test_cost_rose(alpha: float, best: int) -> None:
    """The third test stops at the first rise; what is returned is the iterate before it."""
    solution = solve(arm_scenario("arm-001").ocp(), Schuetz(step=FixedStep(alpha)))
    costs = history(solution)
    assert solution.status is Status.COST_ROSE
    assert np.all(np.diff(costs[:-1]) < 0.0)
    assert costs[-1] > costs[-2]
    assert solution.cost == costs.min() == costs[best]
    assert solution.residual == solution.history["residual"][best]
    # Euler's own cost, so only roughly that of the controls.
    assert evaluate(solution).cost == pytest.approx(solution.cost, rel=0.1)


def test_iteration_limit() -> None:
    solution = solve(arm_scenario("arm-001").ocp(), Schuetz(step=FixedStep(0.01), max_iterations=3))
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.iterations == 3
    assert len(history(solution)) == 4
    assert (solution.work.rollouts, solution.work.jacobians) == (4, 4)


def test_a_fixed_step_climbs_with_conjugate_directions_only() -> None:
    """Past the bottom beta exceeds one: the cost climbs to overflow, without the third test.

    Steepest descent (3.65) with the same step stays at the bottom, and finds it.
    """
    ocp = arm_scenario("arm-001").ocp()
    options: dict[str, Any] = {"step": FixedStep(0.05), "stop_on_rise": False, "decrease": 0.0}
    climbing = solve(ocp, Schuetz(direction="fletcher-reeves", **options))
    costs = history(climbing)
    assert climbing.status is Status.DIVERGED
    assert costs[-1] > 1e3 * costs.min()
    assert np.all(np.diff(costs[costs.argmin() :]) > 0.0)
    assert climbing.cost == costs.min()
    staying = solve(ocp, Schuetz(direction="steepest", judged=False, **options))
    costs = history(staying)
    assert staying.status is Status.STATIONARY
    assert costs[-1] == pytest.approx(costs.min(), rel=1e-5)  # of Euler's cost, not of its gradient
    # A stationary answer is the last iterate, not one that Euler likes better.
    assert staying.cost == costs[-1]
    assert staying.residual == staying.history["residual"][-1] <= 1e-5


def test_with_a_small_step_it_ends_near_the_bottom() -> None:
    """alpha = 0.01 on `closest`: within half a percent of the optimum (findings: 0.02-0.07 %)."""
    for name, optimum in (("arm-001", 3.805482538), ("arm-002", 3.326905573)):
        solution = solve(arm_scenario(name).ocp("closest"), Schuetz(step=FixedStep(0.01)))
        assert 0.0 < evaluate(solution).cost / optimum - 1.0 < 5e-3


def test_the_raw_cost_of_the_thesis() -> None:
    """H_yy is singular, which descent does not mind; the answer is that of the regular cost."""
    scenario = arm_scenario("arm-001")
    answers = [
        solve(scenario.ocp(cost=cost), Schuetz(step=FixedStep(0.01)))
        for cost in ("raw", "regularised")
    ]
    assert all(s.status is Status.SMALL_DECREASE for s in answers)
    costs = [evaluate(s).cost for s in answers]
    assert costs[0] == pytest.approx(costs[1], rel=1e-3)  # stopped at slightly different places


# -- the gradient ---------------------------------------------------------------------


def gradient_of(solver: Schuetz, ocp: OCP, u: np.ndarray) -> np.ndarray:
    """H_u per second, (N, nu), read off one small step of steepest descent."""
    step = 1e-4
    solver = replace(
        solver, direction="steepest", step=FixedStep(step), max_iterations=1, decrease=0.0
    )
    # Samples whose linear interpolation returns u unchanged at the first N nodes.
    guess = Guess(u=np.vstack([u, u[-1:]]))
    return (u - solve(ocp, solver, guess=guess).u) / step


@pytest.mark.parametrize("integrator", [Euler(), RK4(), RK4(steps=2)])
@pytest.mark.parametrize("make", [van_der_pol, tracker])
def test_discrete_gradient(integrator, make: Callable[[], OCP]) -> None:
    """Per second of an interval, against differences of the discretised cost."""
    ocp, n = make(), 12
    solver = Schuetz(intervals=n, integrator=integrator, gradient="discrete")
    program = solver.prepare(ocp)
    h = ocp.duration / n
    u = 0.5 * np.random.default_rng(3).normal(size=(n, 1))
    data = RunData.of(ocp, t0=0.0)
    times, nodes = np.arange(n)[None, :] * h, np.linspace(0.0, 1.0, n + 1)
    left, right = data.values.on(nodes)

    def cost(controls: np.ndarray) -> float:
        schedule = [times, np.full((1, n), h), left.T, right.T]
        x, costs = program.sweeps.forwards(data.x0, controls[None, :], *schedule)
        end = ocp.functions.terminal_cost(x[:, -1], ocp.duration, data.values.at(1.0)[0])
        return float(ca.sum2(costs)) + float(end)

    got = gradient_of(solver, ocp, u)
    expected = gradient(cost, u[:, 0]) / h
    # The gradient was divided by a step of 1e-4: twelve digits of u leave eight.
    np.testing.assert_allclose(got[:, 0], expected, atol=DERIVATIVE * 10)


def test_both_gradients_meet_with_the_first_order_of_euler() -> None:
    counts = np.array([50, 100, 200, 400])
    errors = []
    for n in counts:
        u = np.full((int(n), 1), 0.3)
        found = [
            gradient_of(Schuetz(intervals=int(n), gradient=kind), van_der_pol(), u)
            for kind in ("continuous", "discrete")
        ]
        errors.append(np.abs(found[0] - found[1]).max())
    np.testing.assert_allclose(-np.diff(np.log2(errors)), 1.0, atol=ORDER)


# -- the sound version ----------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "arm-001",
        "arm-003",
        *(pytest.param(f"arm-{i:03d}", marks=pytest.mark.slow) for i in (4, 9, 21)),
    ],
)
def test_sound_reaches_the_bottom_of_its_basin(name: str) -> None:
    """The direct method, started from its answer, finds nothing lower by 1e-3."""
    ocp = arm_scenario(name).ocp()
    solution = solve(ocp, Schuetz.sound())
    bottom = solve(ocp, MultipleShooting(75), guess=solution)
    assert bottom.status is Status.SOLVED
    gap = evaluate(solution).cost / evaluate(bottom).cost - 1.0
    assert abs(gap) <= GAP["gradient"]
    assert np.all(np.diff(history(solution)) <= 0.0)


def test_control_bounds_by_projection() -> None:
    ocp = changed(van_der_pol(), control_bounds=Box(0.1, 0.5))
    solution, direct = solve(ocp, Schuetz.sound(intervals=50)), solve(ocp, MultipleShooting(50))
    assert solution.status is Status.STATIONARY
    assert (solution.u.min(), solution.u.max()) == (0.1, 0.5)
    assert evaluate(solution).cost == pytest.approx(evaluate(direct).cost, rel=SAME_PROGRAM)
    np.testing.assert_allclose(solution.u, direct.u, atol=1e-4)  # stationary to 1e-5


def test_discrete_time() -> None:
    ocp = discrete_double_integrator(20, 0.2)
    solution, direct = solve(ocp, Schuetz.sound()), solve(ocp, MultipleShooting())
    assert solution.status is Status.STATIONARY
    assert solution.cost == pytest.approx(direct.cost, rel=CERTIFIED)
    np.testing.assert_allclose(solution.costate, direct.costate, atol=1e-4)  # stationary to 1e-5


def test_data_change_without_rebuilding() -> None:
    program, direct = (
        Schuetz.sound(intervals=60).prepare(tracker()),
        MultipleShooting(60).prepare(tracker()),
    )
    runs: tuple[dict[str, Any], ...] = ({}, {"parameters": OTHER, "x0": [-0.4, 0.6], "t0": 0.7})
    for run in runs:
        got, expected = program.run(**run), direct.run(**run)
        assert got.status is Status.STATIONARY
        assert got.cost == pytest.approx(expected.cost, rel=CERTIFIED)
        assert got.t[0] == run.get("t0", 0.0)


def test_at_the_optimum_it_does_nothing() -> None:
    ocp = van_der_pol()
    first = solve(ocp, Schuetz.sound(intervals=40))
    again = solve(ocp, Schuetz.sound(intervals=40), guess=first)
    assert again.iterations == 0
    assert again.status is Status.STATIONARY
    np.testing.assert_allclose(again.u, first.u, atol=ROUNDING)


def test_deterministic() -> None:
    ocp = arm_scenario("arm-002").ocp()
    one, other = solve(ocp, Schuetz.sound()), solve(ocp, Schuetz.sound())
    np.testing.assert_array_equal(one.u, other.u)
    assert one.work == other.work


# -- what it refuses ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "term"),
    [
        (double_integrator_energy, r"terminal constraint \('end'\)"),
        (lambda: circle_start((1.0, 0.0)), r"initial constraint \('circle'\)"),
        (lambda: arm_scenario("arm-001").ocp(form="velocity"), r"path constraint \('task'\)"),
        (lambda: changed(bryson_denham(), constraints=()), "state bounds"),
        (lambda: changed(timed_transfer(), constraints=()), "free final time"),
    ],
)
def test_refusals_name_the_term(make: Callable[[], OCP], term: str) -> None:
    ocp = make()
    with pytest.raises(UnsupportedProblem, match=term) as error:
        Schuetz.sound().prepare(ocp)
    assert str(error.value).startswith(ocp.name)


def test_the_continuous_gradient_refuses_discrete_time() -> None:
    with pytest.raises(UnsupportedProblem, match="discrete in time"):
        Schuetz().prepare(discrete_double_integrator(5, 0.1))


@pytest.mark.parametrize(
    "make",
    [
        lambda: Schuetz(intervals=0),
        lambda: Schuetz(max_iterations=0),
        lambda: Schuetz(direction="newton"),  # pyright: ignore[reportArgumentType]
        lambda: Schuetz(gradient="none"),  # pyright: ignore[reportArgumentType]
        lambda: Schuetz(decrease=-1.0),
        lambda: Schuetz(stationarity=-1.0),
    ],
)
def test_bad_options(make: Callable[[], object]) -> None:
    with pytest.raises(ProblemError):
        make()


def test_a_first_guess_that_blows_up() -> None:
    solution = solve(van_der_pol(), Schuetz.sound(), guess=Guess(u=[1e9]))
    assert solution.status is Status.DIVERGED
    assert "first controls" in solution.message
    assert np.isfinite(solution.x).all()


@pytest.mark.parametrize("gradient", ["continuous", "discrete"])
def test_a_costate_that_blows_up_where_the_cost_does_not(gradient: Any) -> None:
    """sqrt(x) has no slope at 0, where the point stays without control."""
    ocp = point(terminal_cost=lambda x, u: ca.sqrt(x))
    solution = solve(ocp, Schuetz(gradient=gradient))
    assert solution.status is Status.DIVERGED
    assert "costate" in solution.message


def test_armijo_is_a_step_rule() -> None:
    assert Schuetz.sound().step == Armijo()
