"""A success and the referee agree, in every solver alike, or the solution says what differs."""

import casadi as ca
import numpy as np
import pytest

from ocp import OCP, Box, Constraint, Model, Signal, Status, evaluate, solve
from solvers import (
    AugmentedLagrangian,
    BetweenNodes,
    Collocation,
    IndirectShooting,
    MultipleShooting,
    Riccati,
    Schuetz,
    StagewiseNewton,
    polish,
)
from tests.ocp.problems import energy, integrator, lag

X, U, T = (ca.SX.sym(name) for name in "xut")


def problem(f: ca.SX, running_cost: ca.SX, **changes) -> OCP:
    model = Model(name="one state", x=X, u=U, t=T, f=f)
    given = {"name": "judged", "x0": [0.0], "horizon": 1.0, "running_cost": running_cost}
    return OCP(model=model, **(given | changes))


WAVE = problem(U + 3 * ca.sin(4800 * ca.pi * T) ** 2, U**2, terminal_cost=100 * (X - 1) ** 2)


@pytest.mark.many
@pytest.mark.parametrize(
    "solver",
    [
        MultipleShooting(75),
        StagewiseNewton(75),
        Schuetz.sound(intervals=75),
        IndirectShooting(steps=75),
    ],
)
def test_a_wave_between_the_samples_is_not_overlooked(solver) -> None:
    """4800 periods look like none on 75 intervals: 0.99 for 223."""
    solution = solve(WAVE, solver)
    assert solution.status is Status.INACCURATE
    assert "own cost" in solution.message
    assert "the referee's 223" in solution.message


def test_the_accuracy_is_an_option_and_inf_switches_the_comparison_off() -> None:
    assert solve(WAVE, MultipleShooting(75, accuracy=np.inf)).status is Status.SOLVED
    assert solve(WAVE, MultipleShooting(75, judged=False)).status is Status.SOLVED


def test_knots_of_a_signal_between_the_nodes_are_named_as_the_cause() -> None:
    r = ca.SX.sym("r")
    reference = Signal("reference", r, [0.0, 5.0, -3.0, 7.0, 0.0, 2.0, -9.0, 1.0])
    ocp = problem(U + r, (X - r) ** 2 + 0.01 * U**2, parameters=(reference,))
    off = solve(ocp, MultipleShooting(6))
    assert off.status is Status.INACCURATE
    assert "knots of signal 'reference'" in off.message
    assert "a multiple of 7 intervals" in off.message
    for intervals in (7, 24, 28):
        assert solve(ocp, MultipleShooting(intervals)).status is Status.SOLVED


@pytest.mark.many
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_the_comparison_knows_no_units(unit: float) -> None:
    """A cost in other units, and an optimum whose cost is zero."""
    wave = problem(WAVE.model.f, unit * U**2, terminal_cost=unit * 100 * (X - 1) ** 2)
    solver = MultipleShooting(75, tolerance=1e-9)
    assert solve(wave, solver).status is not Status.SOLVED
    still = problem(-X + U, unit * (X**2 + U**2))
    assert solve(still, solver).status is Status.SOLVED


def test_a_missed_end_is_no_success() -> None:
    """Between the nodes the rate has a bump that no step of the solver sees."""
    bump = 2.0 * ca.exp(-(((T - 0.5375) / 0.003) ** 2)) / 0.003
    goal = Constraint("goal", X, 1.0, 1.0, at="terminal")
    ocp = problem(U + bump, U**2, constraints=(goal,))
    solution = solve(ocp, MultipleShooting(10, accuracy=0.5))
    assert solution.status is Status.INACCURATE
    assert "terminal constraint 'goal' is missed by 3.5" in solution.message


def test_what_is_violated_between_the_nodes_is_named_and_stays_a_success() -> None:
    """The floor x >= sin(2 pi t) - 1 is touched where it is highest, at t = 1/4 s."""
    floor = Constraint("floor", X - ca.sin(2 * ca.pi * T) + 1.0, lower=0.0)
    ocp = problem(U, 10 * X + U**2, constraints=(floor,))
    solution = solve(ocp, MultipleShooting(6))
    assert solution.status is Status.SOLVED
    verdict = evaluate(solution)
    assert verdict.violation > 1e-3
    assert solution.message.startswith("between the nodes, constraint 'floor' is violated by")
    assert solution.message.endswith("; BetweenNodes holds it there")
    held = solve(ocp, BetweenNodes(MultipleShooting(6)))
    assert (held.status, held.message) == (Status.SOLVED, "")


def test_what_only_a_feedback_can_follow_is_no_plan() -> None:
    """dx/dt = 5 x + u over 10 s: errors grow by e^50 = 5e21."""
    ocp = problem(5 * X + U, X**2 + U**2, x0=[1.0], horizon=10.0)
    solution = solve(ocp, StagewiseNewton(200))
    assert solution.status is Status.INACCURATE
    assert solution.message == "open loop, errors grow by 5e21: only a feedback can follow it"


@pytest.mark.parametrize("solver", [MultipleShooting(200), Collocation(60)])
def test_unstable_dynamics_are_solved_where_an_open_loop_plan_means_something(solver) -> None:
    """dx/dt = x + u over 20 s from 1, min int x^2 + u^2: costate 2 (1 + sqrt 2) x, cost 1 + sqrt 2.

    Errors grow by e^20 = 5e8, rounding to 1e-7.
    """
    end = Constraint("end", X, 0.0, 0.0, at="terminal")
    ocp = problem(X + U, X**2 + U**2, x0=[1.0], horizon=20.0, constraints=(end,))
    solution = solve(ocp, solver)
    verdict = evaluate(solution)
    assert solution.status is Status.SOLVED
    assert verdict.cost == pytest.approx(1 + np.sqrt(2), rel=1e-2)
    assert abs(solution.cost - verdict.cost) <= verdict.cost_error + 1e-4 * verdict.cost


def test_right_answers_stay_what_they_were() -> None:
    for ocp, solver in ((energy(), MultipleShooting(20)), (lag(), MultipleShooting())):
        solution = solve(ocp, solver)
        assert (solution.status, solution.message) == (Status.SOLVED, "")
    assert polish(solve(energy(), MultipleShooting(20))).status is Status.SOLVED


def test_methods_around_solvers_judge_as_well() -> None:
    floor = Constraint("floor", X + 1.0, lower=0.0)
    wave = problem(WAVE.model.f, U**2, terminal_cost=WAVE.terminal_cost, constraints=(floor,))
    for solver in (
        BetweenNodes(MultipleShooting(75)),
        AugmentedLagrangian(Schuetz.sound(intervals=75)),
    ):
        solution = solve(wave, solver)
        verdict = evaluate(solution)
        agrees = abs(solution.cost - verdict.cost) <= 1e-2 * verdict.cost
        assert agrees or not solution.status.is_success


def test_nobody_pays_twice() -> None:
    solution = solve(energy(), MultipleShooting(20))
    assert evaluate(solution) is evaluate(solution.with_(message="a copy"))
    assert evaluate(solution.with_(u=solution.u + 1.0)) is not evaluate(solution)


def test_a_control_loop_does_not_pay_at_all() -> None:
    for solver in (MultipleShooting(20), StagewiseNewton(20), Schuetz(), Collocation(5)):
        assert not solver.for_control_loop(compiled=False, time_limit=1.0).judged
    box = integrator(control_bounds=Box(-1.0, 1.0))
    assert solve(box, MultipleShooting(5, judged=False)).status is Status.SOLVED


def test_discrete_plans_that_only_a_feedback_can_follow_are_solved_and_say_so() -> None:
    """x+ = 4 x + u over 40 steps: errors grow by 4^40 = 1e24; nothing is integrated."""
    model = Model(name="doubling", x=X, u=U, f=4.0 * X + U, dt=0.1)
    ocp = OCP(name="d", model=model, x0=[1.0], horizon=40, running_cost=X**2 + U**2)
    solution = solve(ocp, Riccati())
    assert solution.status is Status.SOLVED
    assert "open loop, errors grow by 1e24" in solution.message
    assert evaluate(solution).cost == pytest.approx(solution.cost, rel=1e-9)
