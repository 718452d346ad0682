import casadi as ca
import numpy as np
import pytest

from models import stable_plant, thesis_regulator, unstable_plant
from models.textbook import van_der_pol
from ocp import OCP, Box, Constraint, Model, ProblemError, Status, costates_along, evaluate, solve
from solvers import Greedy, MultipleShooting
from tests.linear_dp.problems import line, scalar, tracking, unstable_mass, walk


def test_scalar_by_hand():
    # q = (0.9 x + u)^2 + u^2 is least at u = -0.45 x; in the last step u^2 + (0.9 x + u)^2 too.
    solution = solve(scalar(4), Greedy())
    x = 0.45 ** np.arange(5)
    np.testing.assert_allclose(solution.x[:, 0], x, atol=1e-8)
    np.testing.assert_allclose(solution.u[:, 0], -0.45 * x[:-1], atol=1e-8)
    assert solution.status is Status.MYOPIC
    assert not solution.status.is_success


# Cost of greedy control over that of the optimum: at least this (the inequality 1.4). The
# first two plants have a zero outside the unit circle, which one step does not see.
INEQUALITY = {
    "stable plant": (lambda: thesis_regulator(stable_plant(), 50), 26.6),
    "unstable plant": (lambda: thesis_regulator(unstable_plant(), 50), 1e6),
    "unstable mass": (lambda: unstable_mass(50), 14.0),
    "Van der Pol": (van_der_pol, 1.8),
    "scalar": (scalar, 1.0),
    "tracking": (tracking, 1.0),
}


@pytest.mark.parametrize(("make", "ratio"), INEQUALITY.values(), ids=INEQUALITY.keys())
def test_inequality_of_the_thesis(make, ratio):
    problem = make()
    greedy = solve(problem, Greedy(intervals=30))
    optimum = solve(problem, MultipleShooting(intervals=30)).or_raise()
    assert greedy.status is Status.MYOPIC
    judged = evaluate(greedy)
    assert judged.cost >= ratio * evaluate(optimum).cost
    assert judged.violation <= 1e-8
    assert greedy.cost == pytest.approx(judged.cost, rel=1e-4)


def test_costates_are_those_along_its_own_controls():
    solution = solve(van_der_pol(), Greedy(intervals=40))
    truth = costates_along(solution).costate
    assert np.abs(solution.costate - truth).max() <= 1e-4 * np.abs(truth).max()


def test_bounds_hold_exactly():
    problem = unstable_mass(40, control_bounds=Box(-5.0, 5.0), x0=[0.5, 0.0])
    solution = solve(problem, Greedy())
    assert np.abs(solution.u).max() <= 5.0
    assert np.abs(solution.u).max() == pytest.approx(5.0)


def test_state_bounds_and_path_constraints_at_the_next_state():
    model = line("walk", 1.0)
    fence = Constraint("fence", model.x, upper=2.5)
    speed = Constraint("speed", model.u - 0.1 * model.x, upper=0.4)
    cost = (model.x - 5.0) ** 2
    limits = {"constraints": (fence, speed), "running_cost": cost, "terminal_cost": cost}
    problem = walk(8, model=model, x0=0.0, **limits)
    solution = solve(problem, Greedy())
    assert solution.status is Status.MYOPIC
    assert solution.x[:, 0].max() <= 2.5 + 1e-7
    assert solution.x[-1, 0] == pytest.approx(2.5, abs=1e-6)
    assert (solution.u[:, 0] - 0.1 * solution.x[:-1, 0]).max() <= 0.4 + 1e-7


def test_a_bound_that_was_not_foreseen_is_named():
    # Towards x0 = 1.9 with 8 m/s, no control keeps the bound at 2.
    solution = solve(unstable_mass(10, x0=[1.9, 8.0]), Greedy())
    assert solution.status is Status.INFEASIBLE
    assert "step 0" in solution.message
    assert "bound of x_0" in solution.message
    assert solution.cost == np.inf
    assert np.abs(solution.u).max() <= 40.0


def test_a_terminal_constraint_counts_in_the_last_step_only():
    reached = solve(walk(x0=2.0, steps=1), Greedy())
    assert reached.status is Status.MYOPIC
    assert reached.x[-1, 0] == pytest.approx(1.0, abs=1e-6)
    missed = solve(walk(x0=4.0), Greedy())
    assert missed.status is Status.INFEASIBLE
    assert "step 2" in missed.message
    assert "'home'" in missed.message


def test_a_state_that_blows_up():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    problem = OCP(
        name="escape",
        model=Model(name="escape", x=x, u=u, f=ca.exp(x**2) + u, dt=1.0),
        x0=1.0,
        horizon=8,
        running_cost=u**2,
    )
    solution = solve(problem, Greedy())
    assert solution.status is Status.DIVERGED
    assert solution.cost == np.inf


def test_time_and_signals_are_those_of_the_next_node():
    program = Greedy(intervals=60).build(tracking())
    solution = program.run(t0=0.3)
    w = np.interp(solution.fractions, np.linspace(0, 1, 7), np.sin(4 * np.linspace(0, 1, 7)))
    # The lighter the control weighs, the closer one step gets: here h 0.1 u^2, x+ = x + 0.3 h u.
    assert solution.work.factorisations > 0
    still = program.run(t0=0.3, parameters={"w": np.zeros(7)})
    assert np.abs(solution.x[:, 0] - w).mean() < np.abs(still.x[:, 0] - w).mean()


def test_a_control_that_is_fixed():
    solution = solve(scalar(4, control_bounds=Box(0.1, 0.1)), Greedy())
    assert solution.status is Status.MYOPIC
    np.testing.assert_array_equal(solution.u, 0.1)


def test_more_terminal_equations_than_controls_print_nothing(capfd):
    model = line("walk", 1.0)
    ends = ca.vertcat(model.x, model.x**2 + 1.0)
    ends = Constraint("ends", ends, 0.0, 0.0, at="terminal")
    solution = solve(walk(model=model, constraints=(ends,)), Greedy())
    assert solution.status is Status.INFEASIBLE
    assert "'ends'" in solution.message
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("bad", [{"intervals": 0}, {"tolerance": 0.0}, {"max_iterations": 0}])
def test_bad_options(bad):
    with pytest.raises(ProblemError):
        Greedy(**bad)
