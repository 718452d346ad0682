"""Terms of the normal form together, with runs that differ from what is declared."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from ocp import (
    OCP,
    Box,
    Constraint,
    Guess,
    Model,
    Plant,
    ProblemError,
    Soft,
    Status,
    Unknown,
    discretise,
    evaluate,
    solve,
)
from solvers import Collocation, IndirectShooting, MultipleShooting, multistart

X, U, K, T, P, V = (ca.SX.sym(name) for name in ("x", "u", "k", "t", "p", "v"))
LINE = Model(name="line", x=X, u=U, f=U, t=T)
MASS = Model(name="mass", x=ca.vertcat(P, V), u=U, f=ca.vertcat(V, U))


def line(**changes: Any) -> OCP:
    given: dict[str, Any] = {
        "name": "line",
        "model": LINE,
        "x0": [0.0],
        "horizon": 1.0,
        "running_cost": U**2,
        "terminal_cost": (X - 1) ** 2,
    }
    return OCP(**(given | changes))


DIRECT = [MultipleShooting(80), Collocation(8)]


@pytest.mark.parametrize("solver", DIRECT, ids=repr)
def test_a_guess_beside_slacks_and_integrals(solver):
    soft = Constraint("low", X, upper=0.2, soft=Soft(1, 1))
    budget = Constraint("budget", U**2, upper=0.2, at="integral")
    found = solve(line(constraints=(soft, budget)), solver, guess=Guess(x=[0.0], u=[0.3]))
    assert found.status.is_success


@pytest.mark.parametrize("solver", DIRECT, ids=repr)
def test_a_run_that_begins_later_guesses_at_its_own_time(solver):
    budget = Constraint("budget", U**2 / (T - 0.5) ** 2, upper=0.2, at="integral")
    program = solver.build(line(constraints=(budget,)))
    found = program.run(t0=2.0, guess=Guess(x=[0.0], u=[1.0])).or_raise()
    assert found.cost == pytest.approx(program.run(t0=2.0).cost, rel=1e-6)


@pytest.mark.parametrize("solver", DIRECT, ids=repr)
def test_what_is_free_of_a_start_is_not_blamed(solver):
    """Its guess lies outside bounds and rows that the start that was found meets."""
    arrival = Constraint("arrival", MASS.x, [1, 0], [1, 0], at="terminal")
    fast = OCP(
        name="fast",
        model=MASS,
        x0=[0, 5.0],
        horizon=1.0,
        running_cost=U**2 / 2,
        free_start=("v",),
        state_bounds=Box([-np.inf, -1], [np.inf, 2]),
        constraints=(arrival,),
    )
    assert solve(fast, solver).status is Status.SOLVED
    below = line(
        x0=[1.0],
        running_cost=U**2,
        terminal_cost=K**2 / 2,
        constraints=(
            Constraint("end", X, 1.5, 1.5, at="terminal"),
            Constraint("below", X - K, upper=0),
        ),
        unknowns=(Unknown("top", K, 0.2),),
    )
    found = solve(below, solver).or_raise()
    assert found.unknowns["top"] == pytest.approx([1.5], abs=1e-6)


@pytest.mark.parametrize("solver", DIRECT, ids=repr)
def test_a_measured_start_is_not_held_to_rows_that_it_decides(solver):
    ocp = line(
        x0=[1.0],
        constraints=(
            Constraint("end", X, 0, 0, at="terminal", soft=Soft(9.0)),
            Constraint("below", X, upper=1.0),
        ),
    )
    found = solver.build(ocp).run(x0=[1 + 1e-8])
    assert found.status.is_success


def test_a_start_on_its_bound_but_for_rounding_is_judged():
    ocp = OCP(
        name="edge",
        model=MASS,
        x0=[0, 0.0],
        horizon=1.0,
        running_cost=U**2 / 2 + (V - 1) ** 2 / 2,
        constraints=(Constraint("end", P, 1, 1, at="terminal"),),
        free_start=("v",),
        start_bounds=Box([-np.inf, -np.inf], [np.inf, 1 - 1e-8]),
    )
    assert solve(ocp, IndirectShooting(5)).status is Status.STATIONARY


VALLEYS = line(
    terminal_cost=(K**2 - 1) ** 2 + (X - K) ** 2, unknowns=(Unknown("side", K, guess=0.5),)
)


@pytest.mark.parametrize("solver", DIRECT, ids=repr)
def test_a_guess_of_a_constant_alone_is_taken(solver):
    sides = [
        solve(VALLEYS, solver, guess=Guess(unknowns={"side": value})).unknowns["side"][0]
        for value in (-1.0, 1.0)
    ]
    assert sides[0] < 0 < sides[1]


def test_other_starts_vary_the_constants():
    found = multistart(VALLEYS, MultipleShooting(5), 8, 0)
    assert {np.sign(optimum.solution.unknowns["side"][0]) for optimum in found} == {-1.0, 1.0}


def test_the_referee_sees_a_constant_outside_its_bounds():
    ocp = line(terminal_cost=(X - K) ** 2, unknowns=(Unknown("top", K, 0.2, 0.1, 0.5),))
    found = solve(ocp, MultipleShooting(5))
    assert evaluate(found).violation < 1e-8
    moved = evaluate(found.with_(unknowns={"top": np.array([9.0])}))
    assert (moved.violation, moved.worst) == (pytest.approx(8.5), "bound of k")


def test_discretised_both_ends_stay_coupled():
    ocp = line(
        terminal_cost=0.0, constraints=(Constraint("lap", X - LINE.start, 1, 1, at="terminal"),)
    )
    steps = solve(discretise(ocp, 0.1), MultipleShooting()).or_raise()
    assert steps.x[-1] == pytest.approx([1.0], abs=1e-8)


def test_names_that_mean_two_things_are_refused():
    again = ca.SX.sym("x")
    with pytest.raises(ProblemError, match="its symbol is called 'x' as another symbol is"):
        line(terminal_cost=again**2, unknowns=(Unknown("k", again, 1.0),))
    both = ca.vertcat(ca.SX.sym("q"), ca.SX.sym("q"))
    with pytest.raises(ProblemError, match="two states are called 'q'"):
        OCP(
            name="twins",
            model=Model(name="m", x=both, u=U, f=ca.vertcat(U, U)),
            x0=[0, 0],
            horizon=1.0,
            free_start=("q",),
        )


def test_a_plant_refuses_a_constant_that_nobody_has_chosen():
    with pytest.raises(ProblemError, match="'side' of line is an unknown constant"):
        Plant(ocp=VALLEYS)


def test_of_the_start_only_what_terms_contain_is_copied():
    lap = Constraint("lap", P - MASS.start[0], 1, 1, at="terminal")
    ocp = OCP(
        name="lap", model=MASS, x0=[3.0, 0], horizon=1.0, running_cost=U**2, constraints=(lap,)
    )
    found = solve(ocp, Collocation(4)).or_raise()
    assert found.normal is not None
    assert found.normal.x.shape[1] == 3
    assert found.x[-1, 0] == pytest.approx(4.0, abs=1e-8)
