"""Phases in files, copies, text and figures; and what they may start from."""

import copy
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

import ocp
from ocp import (
    Box,
    Constraint,
    FreeTime,
    Guess,
    Link,
    Model,
    Parameter,
    Phases,
    PhasesSolution,
    ProblemError,
    Status,
    Unknown,
    evaluate,
    solve,
)
from ocp.phases.phases_guess import guess_of_all
from ocp.phases.side_by_side import side_by_side
from ocp.problem.run_data import RunData
from solvers import Collocation, IndirectShooting, MultipleShooting, certify, multistart, polish
from solvers.multistart import _guesses
from tests.phases.problems import BALL, BOUNCE, FALL, GRAVITY, RISE, H, T, U, V, hop, phase

FOUND = solve(hop(), Collocation(6)).or_raise()


def test_a_saved_solution_is_read_again(tmp_path):
    path = FOUND.save(tmp_path / "hop")
    again = PhasesSolution.load(path, hop())
    assert repr(again) == repr(FOUND)
    assert again.durations == pytest.approx(FOUND.durations, abs=0)
    assert np.array_equal(again.phases[1].x, FOUND.phases[1].x)
    assert evaluate(again).cost == pytest.approx(evaluate(FOUND).cost, abs=1e-15)
    with pytest.raises(ProblemError, match="another 'hop'"):
        PhasesSolution.load(path, hop(total=1.6))
    with pytest.raises(ProblemError, match="the phases that"):
        PhasesSolution.load(path, FALL)  # type: ignore[arg-type]


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])
def test_copies_are_solved_and_judged_alike(copied):
    there = copied(FOUND)
    assert evaluate(there).cost == pytest.approx(evaluate(FOUND).cost, rel=1e-12)
    assert solve(there.problem, Collocation(6)).cost == pytest.approx(FOUND.cost, rel=1e-12)
    program = copied(Collocation(6).build(hop()))
    assert program.run().cost == pytest.approx(FOUND.cost, rel=1e-12)


def test_the_description_names_phases_and_what_couples_them():
    text = hop(total=Box(1, 2)).describe()
    for said in (
        "hop   (2 phases: fall, rise)",
        "d(height)/dt = speed",
        "height = 0   (ground, terminal)",
        "speed(t0) = (-0.8*speed)   (from fall to rise)",
        "1 <= total duration <= 2 s",
    ):
        assert said in text
    assert repr(FOUND).startswith("<Solution of 'hop' (fall 0.6768 s, rise 0.8232 s): SOLVED")


def test_a_figure_has_all_phases_on_one_clock():
    figure = FOUND.plot()
    height = figure["height"]
    assert height.get_xlim() == pytest.approx((0.0, 1.5))
    assert [text.get_text() for text in height.texts] == ["fall", "rise"]
    assert figure.names[:2] == ("height", "speed")


def test_a_solution_starts_another_solver_and_another_chain():
    exact = IndirectShooting(5, steps=100).build(hop()).run(guess=FOUND)
    assert exact.status.is_success
    assert exact.iterations <= 4
    longer = MultipleShooting(10).build(hop(total=1.6)).run(guess=FOUND)
    assert longer.status.is_success
    again = IndirectShooting(5, steps=100).build(hop()).run(guess=FOUND.phases)
    assert again.cost == pytest.approx(exact.cost, rel=1e-9)


def test_each_phase_may_have_a_guess_of_its_own():
    given = (Guess(x=np.array([[1, 0], [0, -4]]), duration=0.7), None)
    program = MultipleShooting(10, max_iterations=1).build(hop())
    assert program.run(guess=given).durations[0] != program.run().durations[0]
    guessed = replace(FALL, guess=given[0])
    own = MultipleShooting(10, max_iterations=1).build(hop(phases=(guessed, RISE))).run()
    assert own.durations == pytest.approx(program.run(guess=given).durations)


def test_what_phases_share_is_handed_on_to_another_chain():
    drag, place = ca.SX.sym("drag"), ca.SX.sym("place")
    shared = Unknown("drag", drag, 0.1, 0.0, 2.0)

    def chain(height: ca.SX, *more: Constraint) -> Phases:
        x = ca.vertcat(height, V)
        model = Model(name="ball", x=x, u=U, f=ca.vertcat(V, U - GRAVITY - drag * V), t=T)
        fall, rise = (
            replace(p, model=model, parameters=(Parameter("drag", drag, 0.1),), constraints=rows)
            for p, rows in (
                (FALL, (Constraint("ground", height, 0, 0, at="terminal"),)),
                (RISE, (Constraint("top", x, [1, 0], [1, 0], at="terminal"), *more)),
            )
        )
        link = Link(ca.vertcat(height, -BOUNCE * V))
        return hop(phases=(fall, rise), links=(link,), unknowns=(shared,))

    tied = Constraint("known", drag, 1.0, 1.0, at="terminal")
    found = solve(chain(H, tied), MultipleShooting(6)).or_raise()
    assert found.unknowns["drag"] == pytest.approx([1.0])
    other = chain(place)
    side = side_by_side(other)
    data = [RunData.of(p, None, 0.0, {}) for p in other.phases]
    guess = guess_of_all(side, found, data)
    assert isinstance(guess, Guess)
    assert guess.unknowns["drag"] == pytest.approx([1.0])
    again = MultipleShooting(6).build(other).run(guess=found)
    assert again.status.is_success
    assert again.cost <= found.cost


def test_many_starts_find_the_same_hop():
    found = multistart(hop(), MultipleShooting(6), 3, seed=1)
    assert len(found) == 1
    assert found[0].found >= 2
    assert found[0].solution.durations.sum() == pytest.approx(1.5)


def test_the_shortest_way_is_full_push_and_full_brake():
    """Bang-bang, an arc a phase: 1 s each from rest at 0 to rest at 1."""
    free = replace(BALL, f=ca.vertcat(V, U))
    rest = Constraint("rest", BALL.x, [1, 0], [1, 0], at="terminal")
    given = {"model": free, "x0": [0.0, 0.0], "running_cost": 1.0, "horizon": FreeTime(0.7)}
    push = phase("push", control_bounds=Box(1, 1), **given)
    brake = phase("brake", control_bounds=Box(-1, -1), constraints=(rest,), **given)
    found = solve(Phases("shortest", (push, brake)), MultipleShooting(2)).or_raise()
    assert found.durations == pytest.approx([1.0, 1.0], abs=1e-7)
    assert found.cost == pytest.approx(2.0, abs=1e-7)


def test_the_page_runs_as_it_stands():
    page = (Path(__file__).parents[2] / "docs" / "phases.md").read_text(encoding="utf-8")
    code = page.split("```python\n")[1].split("```")[0]
    names: dict[str, Any] = {"ca": ca} | {name: getattr(ocp, name) for name in ocp.__all__}
    exec(code, names | {"Collocation": Collocation}, names)
    assert names["s"].durations == pytest.approx([0.677, 0.823], abs=1e-3)


@pytest.mark.slow  # two methods, other starts, conditions on a grid
def test_an_impact_is_certified():
    certificate = certify(FOUND)
    assert certificate.holds
    assert {check.name for check in certificate.checks} >= {"phases, cost", "phases, feasibility"}


def test_phases_that_are_alike_have_no_unique_solution():
    """Nothing happens between them: time shifts from one to the other at no cost."""
    rest = Constraint("rest", BALL.x, [1, 0], [1, 0], at="terminal")
    free = {"model": replace(BALL, f=ca.vertcat(V, U)), "x0": [0.0, 0.0]}
    pair = (phase("one", **free), phase("two", constraints=(rest,), **free))
    found = solve(Phases("alike", pair, total=1.0), Collocation(6)).or_raise()
    assert found.cost == pytest.approx(6.0, abs=1e-7)
    assert "'one' and 'two' are alike" in found.message
    polished = polish(found)
    assert polished.status is not Status.SOLVED
    assert "not unique" in polished.message
    assert "alike" not in FOUND.message


def test_each_phase_has_random_starts_of_its_own() -> None:
    """With one seed for all, the controls of phases alike would be the same."""
    ((first, second),) = _guesses(hop(), 1, 3, 1.0)
    assert not np.allclose(first.u, second.u)
