"""A warm run in C: the same answers as the phases of every backend, and the same refusals."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from models import cart_pole_upright
from ocp import (
    OCP,
    Box,
    Constraint,
    Guess,
    Model,
    ProblemError,
    Program,
    Solution,
    Status,
    solve,
)
from ocp.internal import ShiftedPlan
from solvers import MultipleShooting
from solvers.direct.multiple_shooting import MultipleShootingProgram
from solvers.direct.native.native_solve import NativeSolve
from solvers.direct.native.warm_run import WarmRun
from tests.native.pendulum import LARGE, SMALL, X, in_large_numbers, pushed
from tests.native.problems import rationed

N = 12
NATIVE = MultipleShooting(N, backend="native", judged=False)
# Both end where the optimality conditions leave 1e-9 or less.
SAME = 1e-7


@pytest.fixture(scope="module")
def program() -> MultipleShootingProgram:
    program = NATIVE.build(pushed())
    assert isinstance(program, MultipleShootingProgram)
    return program


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Runs that the phases have made, one entry each."""
    calls, solve = [], NativeSolve.__call__

    def noted(self, *given):
        calls.append(len(calls))
        return solve(self, *given)

    monkeypatch.setattr(NativeSolve, "__call__", noted)
    return calls


def by_phases(program: Program, monkeypatch: pytest.MonkeyPatch, **given) -> Solution:
    """Run without the quick way."""
    with monkeypatch.context() as patched:
        patched.setattr(WarmRun, "__call__", lambda *_: None)
        return program.run(**given)


@pytest.mark.parametrize("moved", [0.0, 0.07, 0.4, -0.05])
def test_it_is_what_the_phases_return(program, monkeypatch, solved: list[int], moved) -> None:
    base = program.run().or_raise()
    given = {
        "x0": [0.7, -0.1],
        "t0": moved,
        "guess": ShiftedPlan(base, moved),
        "parameters": {"pull": 0.9, "wind": [0.2, 0.0]},
    }
    before = len(solved)
    quick = program.run(**given).or_raise()
    assert len(solved) == before
    slow = by_phases(program, monkeypatch, **given).or_raise()
    assert len(solved) == before + 1
    for name in ("t", "x", "u", "costate", "cost"):
        np.testing.assert_allclose(getattr(quick, name), getattr(slow, name), rtol=0, atol=SAME)
    assert quick.iterations == slow.iterations
    assert quick.work == slow.work
    assert quick.history["cost"].shape == slow.history["cost"].shape
    assert quick.message == slow.message == ""


def test_guesses_of_other_kinds_and_grids_start_it_too(program, solved: list[int]) -> None:
    base = program.run().or_raise()
    finer = replace(NATIVE, intervals=2 * N).build(pushed()).run().or_raise()
    known = Guess(x=base.x, u=np.vstack([base.u, base.u[-1:]]), costate=base.costate)
    before = len(solved)
    for guess in (base, finer, known):
        found = program.run(guess=guess).or_raise()
        assert found.cost == pytest.approx(base.cost, rel=1e-8)
    # From its own answer no control moves: then the phases look whether it is a minimum.
    assert len(solved) > before
    assert len(program.run(guess=Guess(x=base.x)).or_raise().x) == N + 1


def test_what_a_run_has_left_in_the_memory_does_not_matter(program) -> None:
    base = program.run().or_raise()
    given = {"x0": [0.6, 0.1], "guess": base}
    first = program.run(**given)
    program.run(x0=[1.5, -0.4], parameters={"pull": 3.0, "wind": [2.0, 1.0]}, guess=base)
    program.run(x0=[0.3, 0.0])
    again = program.run(**given)
    np.testing.assert_array_equal(first.u, again.u)
    np.testing.assert_array_equal(first.costate, again.costate)


def test_an_answer_that_half_the_step_moves_is_inaccurate() -> None:
    coarse = replace(NATIVE, intervals=3, accuracy=1e-5).build(pushed())
    base = coarse.run()
    assert base.status is Status.INACCURATE
    warm = coarse.run(x0=[0.7, -0.1], guess=base)
    assert warm.status is Status.INACCURATE
    assert "a state moves by" in warm.message


def test_the_error_of_the_half_step_is_that_of_the_grid(program) -> None:
    base = program.run(x0=[0.7, -0.1], guess=program.run().or_raise()).or_raise()
    library = program.nlp.run.library
    account = library.account()
    schedule = program.grid.schedule(base.data, base.duration)
    error, node = program.grid.error(base.x, base.u, schedule)
    assert account.moved == pytest.approx(error, rel=1e-6)
    assert account.node == node


@pytest.mark.parametrize("as_row", [False, True])
def test_a_start_outside_its_bounds_is_told_as_ever(program, monkeypatch, as_row) -> None:
    if as_row:
        slow_enough = Constraint("slow", X[1], lower=-0.9)
        program = NATIVE.build(pushed(state_bounds=Box(), constraints=(slow_enough,)))
    base = program.run().or_raise()
    given = {"x0": [0.7, -1.5], "guess": base}
    quick, slow = program.run(**given), by_phases(program, monkeypatch, **given)
    assert quick.status is slow.status
    assert quick.status is not Status.SOLVED
    assert quick.message == slow.message


def test_a_warm_run_that_fails_is_not_made_twice(program, monkeypatch, solved) -> None:
    base, library = program.run().or_raise(), program.nlp.run.library
    made, solve = [], type(library).solve

    def ended(self, options) -> int:
        made.append(options.warm)
        found = solve(self, options)
        return 2 if options.warm else found  # "no step"

    monkeypatch.setattr(type(library), "solve", ended)
    found = program.run(x0=[0.7, -0.1], guess=base).or_raise()
    assert made == [1.0, 0.0]
    assert found.cost == pytest.approx(by_phases(program, monkeypatch, x0=[0.7, -0.1]).cost)


@pytest.mark.slow
def test_a_scaled_problem_starts_from_its_earlier_plan(monkeypatch, solved) -> None:
    program = NATIVE.build(in_large_numbers())
    base = program.run().or_raise()
    before = len(solved)
    for guess in (base, ShiftedPlan(base, 0.05)):
        given = {"x0": [0.7 * LARGE, 0.0], "t0": 0.05, "guess": guess}
        quick, slow = program.run(**given).or_raise(), by_phases(program, monkeypatch, **given)
        np.testing.assert_allclose(quick.x / LARGE, slow.x / LARGE, atol=SAME)
        np.testing.assert_allclose(quick.u / SMALL, slow.u / SMALL, atol=SAME)
    assert len(solved) == before + 2  # those of the phases
    other = solve(cart_pole_upright(), replace(NATIVE, intervals=5))
    with pytest.raises(ProblemError, match="guess: the solution has 4 of x, 2 are needed"):
        program.run(guess=other)


def test_controls_that_are_given_stay_so() -> None:
    u = ca.SX.sym("u", 2)
    model = Model(name="mass", x=X, u=u, f=ca.vertcat(X[1] + u[0], u[1]))
    cost, box = u[1] ** 2 + X[0] ** 2, Box([0.3, -4.0], [0.3, 4.0])
    ocp = OCP(
        name="led", model=model, x0=[0.2, 0.1], horizon=1.0, running_cost=cost, control_bounds=box
    )
    program = NATIVE.build(ocp)
    base = program.run().or_raise()
    warm = program.run(x0=[0.3, 0.0], guess=base.with_(u=0.0 * base.u)).or_raise()
    np.testing.assert_array_equal(warm.u[:, 0], 0.3)
    assert warm.cost == pytest.approx(program.run(x0=[0.3, 0.0]).cost, rel=1e-8)


def test_rows_of_stages_and_a_free_end(monkeypatch) -> None:
    program = NATIVE.build(rationed())
    base = program.run().or_raise()
    given = {"x0": [0.1, 0.3], "guess": base}
    quick, slow = program.run(**given).or_raise(), by_phases(program, monkeypatch, **given)
    np.testing.assert_allclose(quick.u, slow.u, atol=SAME)
    np.testing.assert_allclose(quick.costate, slow.costate, atol=1e-6)


def test_a_loop_rarely_needs_the_phases(solved: list[int]) -> None:
    ocp = cart_pole_upright()
    program = NATIVE.for_control_loop(compiled=False, time_limit=5.0).build(ocp)
    plan, rng = program.run().or_raise(), np.random.default_rng(0)
    before = len(solved)
    for _ in range(20):
        x0 = np.asarray(ocp.start()) + 1e-3 * rng.normal(size=4)
        plan = program.run(x0=x0, guess=ShiftedPlan(plan, 0.0)).or_raise()
    assert len(solved) == before
