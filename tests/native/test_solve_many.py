"""Many runs at once: the answers of one after the other, whoever computes them."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from ocp import (
    OCP,
    Box,
    Constraint,
    Guess,
    Interrupted,
    Model,
    ProblemError,
    Signal,
    Solution,
    Status,
    evaluate,
    solve,
)
from ocp.internal import scaled
from solvers import Collocation, ManySolutions, MultipleShooting, solve_many
from solvers.direct.multiple_shooting import MultipleShootingProgram
from tests.native.pendulum import PULL, WIND, U, X, pushed
from tests.native.problems import free_time, impossible, rationed
from tests.native.test_warm_run import NATIVE, N

K = 40
# Both end where the optimality conditions leave 1e-9 or less.
SAME = 1e-7
RNG = np.random.default_rng(0)
STARTS = np.array([0.5, 0.0]) + RNG.uniform(-0.4, 0.4, size=(K, 2))
PULLS, WINDS = RNG.uniform(0.5, 1.5, size=K), RNG.uniform(-0.3, 0.3, size=(K, 2))


@pytest.fixture(scope="module")
def program() -> MultipleShootingProgram:
    program = NATIVE.build(pushed())
    assert isinstance(program, MultipleShootingProgram)
    return program


def assert_same(found: ManySolutions, runs: list[Solution]) -> None:
    for i, run in enumerate(runs):
        assert found.status[i] is run.status
        for name in ("t", "x", "u", "costate"):
            np.testing.assert_allclose(
                getattr(found, name)[i], getattr(run, name), rtol=0, atol=SAME
            )
        assert found.cost[i] == pytest.approx(run.cost, rel=1e-9)
        assert found.iterations[i] == run.iterations
        assert found.solution(i).work == run.work


def test_starts_parameters_and_signals_are_those_of_single_runs(program) -> None:
    given = {"pull": PULLS, "wind": WINDS}
    found = solve_many(pushed(), NATIVE, x0=STARTS, t0=0.3, parameters=given)
    runs = [
        program.run(x0=x0, t0=0.3, parameters={"pull": pull, "wind": wind})
        for x0, pull, wind in zip(STARTS, PULLS, WINDS, strict=True)
    ]
    assert_same(found, runs)
    assert found.in_c > 0.8 * K
    assert found.solved.all()
    one = found.solution(3)
    assert one.problem.name == "pushed"
    np.testing.assert_array_equal(one.parameters["pull"], PULLS[3])
    np.testing.assert_array_equal(one.x0, STARTS[3])


@pytest.mark.parametrize("kind", ["controls", "states", "solution", "mixed"])
def test_every_kind_of_guess_starts_as_in_a_single_run(program, kind: str) -> None:
    base, waves = program.run().or_raise(), RNG.normal(size=(K, N + 1, 1))
    guesses = {
        "controls": [Guess(u=wave) for wave in waves],
        "states": Guess(x=base.x, u=[0.3]),
        "solution": base,
        "mixed": [None, base, Guess(u=[1.0]), Guess(x=base.x)] * (K // 4),
    }[kind]
    found = solve_many(pushed(), NATIVE, x0=STARTS, guesses=guesses)
    each = guesses if isinstance(guesses, list) else [guesses] * K
    runs = [program.run(x0=x, guess=g) for x, g in zip(STARTS, each, strict=True)]
    assert_same(found, runs)


def test_threads_do_not_matter() -> None:
    far = STARTS + RNG.normal(size=STARTS.shape)  # some cannot meet their bounds at all
    given = {"x0": far, "parameters": {"pull": PULLS}}
    quick = MultipleShooting(N, backend="native", judged=False, feasibility_restoration=False)
    one, three = (solve_many(pushed(), quick, **given, threads=k) for k in (1, 3))
    assert 0 < one.in_c < K
    assert one.in_c == three.in_c
    assert one.status == three.status
    for name in ("x", "u", "costate", "cost", "iterations", "work"):
        np.testing.assert_array_equal(getattr(one, name), getattr(three, name))


def test_a_start_outside_its_bounds_is_told_as_ever(program) -> None:
    starts = np.array([[0.7, -1.5], [0.7, -0.1]])
    found = solve_many(pushed(), NATIVE, x0=starts)
    assert found.status == (Status.INFEASIBLE, Status.SOLVED)
    assert found.solution(0).message == program.run(x0=starts[0]).message


def test_rows_that_the_start_decides() -> None:
    ocp = pushed(constraints=(Constraint("room", X[0] + WIND, upper=0.9),))
    found = solve_many(ocp, NATIVE, x0=[[0.75, 0.0], [0.85, 0.0]])
    program = NATIVE.build(ocp)
    assert [program.run(x0=x).status for x in ([0.75, 0.0], [0.85, 0.0])] == list(found.status)
    assert found.status[1] is Status.INFEASIBLE
    assert "room" in found.solution(1).message


def test_what_fails_goes_through_the_phases() -> None:
    found = solve_many(impossible(), MultipleShooting(8, backend="native"), x0=[[0.0, 0.0]])
    assert found.in_c == 0
    assert found.status == (Status.INFEASIBLE,)
    assert "goal" in found.solution(0).message
    assert not found.solved.any()


def test_a_solution_is_judged_when_it_is_asked_for() -> None:
    coarse = MultipleShooting(3, backend="native", accuracy=1e-4)
    quick = solve_many(rationed(), coarse, x0=[[0.0, 0.4], [0.1, 0.3]])
    single = solve(rationed(), coarse)
    assert quick.solution(0).status is single.status
    assert quick.solution(0).message == single.message
    good = solve_many(pushed(), MultipleShooting(N, backend="native"), x0=STARTS[:1]).solution(0)
    assert good.cost == pytest.approx(evaluate(good).cost, rel=1e-3)


def test_a_scaled_problem_answers_in_the_units_of_the_user() -> None:
    large = 1e4
    ocp = pushed(
        model=Model(name="far", x=X, u=U, f=ca.vertcat(X[1], U + PULL * X[0] + large * WIND)),
        x0=[0.8 * large, 0.0],
        running_cost=(X[0] / large) ** 2 + 0.1 * (X[1] / large) ** 2 + 0.05 * (U / large) ** 2,
        control_bounds=Box(-2.5 * large, 2.5 * large),
        state_bounds=Box([-2.0 * large, -0.9 * large], [2.0 * large, 2.0 * large]),
    )
    assert scaled(ocp) is not None
    program = NATIVE.build(ocp)
    base, starts = program.run().or_raise(), large * STARTS[:6]
    for guesses in (None, base, [None, base] * 3, Guess(u=[large])):
        found = solve_many(ocp, NATIVE, x0=starts, guesses=guesses)
        assert found.in_c == 6
        each = guesses if isinstance(guesses, list) else [guesses] * 6
        for i in range(6):
            run = program.run(x0=starts[i], guess=each[i]).or_raise()
            np.testing.assert_allclose(found.x[i], run.x, atol=SAME * large)
            np.testing.assert_allclose(found.u[i], run.u, atol=SAME * large)
            np.testing.assert_allclose(found.costate[i], run.costate, atol=SAME / large)
            assert found.cost[i] == pytest.approx(run.cost, rel=1e-8)


@pytest.mark.parametrize("kind", ["none", "duration", "solution"])
def test_a_free_final_time(kind: str) -> None:
    ocp, solver = free_time(), replace(NATIVE, intervals=20)
    program = solver.build(ocp)
    base = program.run().or_raise()
    guess = {"none": None, "duration": Guess(duration=4.0, u=[0.5]), "solution": base}[kind]
    starts = np.array([[0.0, 0.0], [0.2, 0.1], [-0.3, 0.2], [0.5, -0.2], [0.1, 0.9]])
    found = solve_many(ocp, solver, x0=starts, t0=0.5, guesses=guess)
    runs = [program.run(x0=x, t0=0.5, guess=guess) for x in starts]
    assert found.in_c >= 3
    assert np.ptp(found.t[:4, -1]) > 0.1
    for i, run in enumerate(runs):
        assert found.status[i] is run.status
        assert found.cost[i] == pytest.approx(run.cost, rel=1e-8)
        np.testing.assert_allclose(found.t[i], run.t, atol=1e-6)
        np.testing.assert_allclose(found.x[i], run.x, atol=1e-6)
        np.testing.assert_allclose(found.costate[i], run.costate, atol=1e-5)
    late = solve_many(ocp, solver, x0=starts[:1], guesses=Guess(duration=50.0))
    assert late.cost[0] == pytest.approx(found.cost[0], rel=1e-6)
    assert found.solution(1).duration == pytest.approx(runs[1].duration, abs=1e-6)


@pytest.mark.parametrize("solver", [MultipleShooting(N), Collocation(4)])
def test_other_solvers_run_one_after_the_other(solver) -> None:
    found = solve_many(pushed(), solver, x0=STARTS[:2])
    single = solver.build(pushed()).run(x0=STARTS[1])
    assert found.in_c == 0
    np.testing.assert_allclose(found.x[1], single.x, atol=1e-9)
    assert found.u.shape == (2, *single.u.shape)
    assert found.solution(1).status is single.status


def ctrl_c(done: int, total: int, said: str = "", /) -> None:
    """Press Ctrl-C once something is done."""
    if done:
        raise KeyboardInterrupt


@pytest.mark.parametrize("solver", [NATIVE, MultipleShooting(N)])
def test_ctrl_c_leaves_what_is_there(solver) -> None:
    with pytest.raises(Interrupted, match="solve_many was stopped") as caught:
        solve_many(pushed(), solver, x0=STARTS[:5], progress=ctrl_c)
    found = caught.value.so_far
    assert isinstance(found, ManySolutions)
    assert found.done.any()
    assert np.isfinite(found.x).all()
    first = int(np.flatnonzero(found.done)[0])
    assert found.solution(first).status.is_success
    for i in np.flatnonzero(~found.done).tolist():
        assert found.status[i] is Status.TIME_LIMIT
        assert found.cost[i] == np.inf
        with pytest.raises(ProblemError, match=f"run {i} was not done"):
            found.solution(i)


def test_without_time_there_is_a_start_and_nothing_else() -> None:
    found = solve_many(pushed(), NATIVE, x0=STARTS, time_limit=1e-9)
    assert not found.done.any()
    np.testing.assert_array_equal(found.x[:, -1], STARTS)
    assert set(found.status) == {Status.TIME_LIMIT}
    assert "TIME_LIMIT" in repr(found)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({}, "nothing differs from run to run: give x0, parameters or a list of guesses"),
        ({"x0": [0.5, 0.0]}, r"x0 has shape \(2,\), \(K, 2\) is needed, a start in each row"),
        ({"x0": np.zeros((3, 4))}, r"x0 has shape \(3, 4\), \(K, 2\) is needed"),
        ({"x0": np.zeros((0, 2))}, r"x0 has shape \(0, 2\), \(K, 2\) is needed"),
        ({"x0": [[0.1, 0.2], [0.3, np.nan]]}, "x0 of run 1 is not finite"),
        ({"x0": "here"}, "x0"),
        ({"x0": STARTS, "guesses": []}, "40 of x0, 0 of guesses; each needs one for every run"),
        ({"x0": STARTS, "parameters": {"pull": [1.0]}}, "1 of pull, 40 of x0"),
        ({"x0": STARTS, "parameters": {"pull": 1.0}}, "'pull' is 1.0, an array with a row for"),
        ({"parameters": {"pull": [1.0, np.inf]}}, "run 1: parameter 'pull'"),
        ({"parameters": {"push": [1.0]}}, "run 0: .*push"),
        ({"parameters": {"wind": np.zeros((2, 3, 2))}}, "run 0: signal 'wind'"),
        ({"parameters": [1.0]}, "parameters"),
        ({"guesses": ["up"]}, "a Guess"),
        ({"x0": STARTS, "guesses": 3}, "a Guess"),
        ({"x0": STARTS, "guesses": Guess(u=[[1.0, 2.0]])}, "guess: u has shape"),
        ({"x0": STARTS, "threads": 0}, "threads"),
        ({"x0": STARTS, "threads": 1.5}, "threads"),
        ({"x0": STARTS, "time_limit": 0.0}, "time_limit"),
        ({"x0": STARTS, "t0": np.nan}, "t0"),
        ({"x0": STARTS, "progress": 3}, "progress"),
    ],
)
def test_what_does_not_fit_is_named(wrong: dict, said: str) -> None:
    with pytest.raises(ProblemError, match=said):
        solve_many(pushed(), NATIVE, **wrong)


@pytest.mark.parametrize("i", [-1, 2, 0.5])
def test_there_is_no_such_run(i) -> None:
    found = solve_many(pushed(), NATIVE, x0=STARTS[:2])
    with pytest.raises(ProblemError, match="solution: "):
        found.solution(i)


def test_the_problem_and_the_solver_are_what_they_are_said_to_be() -> None:
    with pytest.raises(ProblemError, match="solve_many: ocp"):
        solve_many("pushed", NATIVE, x0=STARTS)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="solve_many: solver"):
        solve_many(pushed(), "native", x0=STARTS)  # type: ignore[arg-type]


def test_samples_of_a_signal_may_differ_in_number() -> None:
    ocp: OCP = pushed()
    assert any(isinstance(entry, Signal) for entry in ocp.parameters)
    found = solve_many(ocp, NATIVE, parameters={"wind": [[0.1, 0.2], [0.1, 0.15, 0.2]]})
    assert found.solved.all()
