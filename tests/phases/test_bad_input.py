"""Phases that do not fit together, and what is said of trajectories that do not meet them."""

import re
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import solvers
from ocp import (
    MPC,
    Box,
    Constraint,
    Guess,
    Link,
    Model,
    Parameter,
    Phases,
    PhasesSolution,
    ProblemError,
    Solver,
    SolverError,
    Status,
    Unknown,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import BetweenNodes, Collocation, IndirectShooting, MultipleShooting, Schuetz
from tests.phases.problems import BALL, FALL, IMPACT, RISE, H, U, V, hop, phase

K = ca.SX.sym("k")
OTHER = Model(name="other", x=ca.vertcat(H, ca.SX.sym("angle")), u=U, f=ca.vertcat(U, U))
STEPS = Model(name="steps", x=BALL.x, u=U, f=ca.vertcat(V, U), dt=0.1)
CEILING = Constraint("ceiling", H, upper=1.2)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"phases": (FALL,), "links": ()}, "hop: 1 phase; two or more"),
        ({"phases": (FALL, FALL)}, "hop: two phases are called 'fall'"),
        ({"phases": (FALL, "rise")}, "hop: an entry of phases is a str"),
        ({"phases": FALL}, "hop: phases is"),
        ({"links": (IMPACT,) * 3}, "3 links for 2 phases; give 1, one from each"),
        ({"links": (lambda end: end,)}, "an entry of links is"),
        (
            {"links": (Link(H),)},
            r"to 'rise': the reset has 1 rows, but 2 states.*speed",
        ),
        ({"links": (Link(ca.vertcat(H, K)),)}, "reset contains k"),
        ({"links": (Link(states=("hight",)),)}, "'hight' is no state of 'rise'; they are height"),
        ({"links": (Link(equations=H - 1),)}, "nothing of the start of 'rise'.*model.start"),
        ({"links": (Link(equations=BALL.start[0] - U),)}, "equations contains push"),
        (
            {"phases": (FALL, phase("turn", model=OTHER)), "links": ()},
            "'fall' has no state 'angle' to go on with.*Link\\(reset\\)",
        ),
        (
            {"phases": (FALL, phase("step", model=STEPS, horizon=5))},
            "phase 'step' is discrete in time",
        ),
        (
            {"phases": (replace(FALL, horizon=1.0), replace(RISE, horizon=0.8))},
            "total = 1.5 s is below the sum of the shortest durations: fall 1 s . rise 0.8 s",
        ),
        (
            {"phases": (replace(FALL, horizon=0.5), replace(RISE, horizon=0.8))},
            "total = 1.5 s is above the sum of the longest durations.*FreeTime",
        ),
        ({"total": -1.0}, "hop: total = -1"),
        ({"total": "long"}, "hop: total"),
        ({"total": Box(3, 2)}, "hop: total"),
        ({"unknowns": (Unknown("k", K, 1.0),)}, r"'k' \(k\) is in no phase.*Parameter"),
        (
            {
                "phases": (
                    replace(FALL, terminal_cost=K**2, unknowns=(Unknown("k", K, 1.0),)),
                    replace(RISE, terminal_cost=K**2, unknowns=(Unknown("k", K, 1.0),)),
                )
            },
            "'k' is an unknown constant of 'fall' and of 'rise'.*Phases",
        ),
    ],
)
def test_what_does_not_fit_is_named(changes, said):
    with pytest.raises(ProblemError, match=said):
        hop(**changes)


def test_links_that_say_too_much_or_nothing():
    with pytest.raises(ProblemError, match="equations say all"):
        Link(H, equations=H - BALL.start[0])
    with pytest.raises(ProblemError, match="link: reset"):
        Link(lambda end: end)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="link: states"):
        Link(states="height")  # type: ignore[arg-type]


def every_solver() -> list[Solver]:
    kinds = [getattr(solvers, name) for name in solvers.__all__]
    found = [k for k in kinds if isinstance(k, type) and issubclass(k, Solver)]
    inner = MultipleShooting(5)
    return [k(inner) if k in _AROUND else k() for k in found if k not in _NEED_MORE]


_AROUND = (BetweenNodes, solvers.AugmentedLagrangian)
_NEED_MORE = (solvers.GridDP, solvers.Greedy, solvers.ReverseShooting)


def test_every_solver_takes_phases_or_refuses_them_by_name():
    taken = []
    for solver in every_solver():
        if solver.takes_phases:
            taken.append(type(solver))
            continue
        with pytest.raises(UnsupportedProblem, match=f"hop: {type(solver).__name__} takes no"):
            solve(hop(), solver)
    assert set(taken) == {MultipleShooting, Collocation, IndirectShooting}
    with pytest.raises(UnsupportedProblem, match="Schuetz takes no phases"):
        Schuetz().build(hop())


def test_a_refused_term_is_named_with_its_phase():
    low = replace(RISE, constraints=(*RISE.constraints, CEILING))
    with pytest.raises(UnsupportedProblem, match=r"hop: .*path constraint.*'rise: ceiling'"):
        solve(hop(phases=(FALL, low)), IndirectShooting())


def test_what_takes_one_problem_says_so():
    with pytest.raises(ProblemError, match="Phases, OCP is needed"):
        MPC(ocp=hop(), solver=MultipleShooting(5), dt=0.1)  # type: ignore[arg-type]


def test_a_guess_has_a_part_for_each_phase():
    for wrong in (Guess(u=[0.0]), (None,), "hop"):
        with pytest.raises(ProblemError, match=r"sequence of 2.*each of fall, rise"):
            solve(hop(), MultipleShooting(5), guess=wrong)
    with pytest.raises(ProblemError, match="rise: the guess is"):
        solve(hop(), MultipleShooting(5), guess=(None, 3.0))
    with pytest.raises(ProblemError, match=r"guess: x has shape \(1, 3\)"):
        solve(hop(), MultipleShooting(5), guess=(Guess(x=[0, 0, 0]), None))


def test_data_that_fit_no_phase():
    program = MultipleShooting(5).build(hop())
    with pytest.raises(ProblemError, match="no phase has a parameter 'wind'; declared are: none"):
        program.run(parameters={"wind": 1.0})
    with pytest.raises(ProblemError, match="fall: x0"):
        program.run(x0=[1, 2, 3])
    with pytest.raises(ProblemError, match="t0"):
        program.run(t0=np.nan)
    known = (Parameter("k", K, 1.0),)
    shared = hop(
        phases=(replace(FALL, terminal_cost=(K - 2) ** 2, parameters=known), RISE),
        unknowns=(Unknown("weight", K, 1.0),),
    )
    program = Collocation(5).build(shared)
    with pytest.raises(ProblemError, match="'weight' is an unknown constant"):
        program.run(parameters={"weight": 1.0})
    assert program.run().unknowns["weight"] == pytest.approx([2.0], abs=1e-6)


def test_what_cannot_be_met_is_named_with_phase_and_time():
    """The ball has to come back to 1 m below a ceiling of 0.9 m; the clock starts at 10 s."""
    low = Constraint("ceiling", H, upper=0.9)
    chain = hop(phases=(FALL, replace(RISE, constraints=(*RISE.constraints, low))))
    found = MultipleShooting(10).build(chain).run(t0=10.0)
    assert found.status is Status.INFEASIBLE
    assert "phase 'rise'" in found.message
    assert re.search(r"at t = 11\.[45]\d* s", found.message)
    with pytest.raises(SolverError, match="rise"):
        found.or_raise()


def test_what_happens_between_the_nodes_is_said_of_its_phase():
    peak = Constraint("ceiling", H, upper=1.02)
    thrown = phase("throw", x0=[0.9, 3.0], horizon=1.0, constraints=(peak, GROUND_AT_END))
    later = phase("later", x0=[0, 0], horizon=1.0)
    found = MultipleShooting(3).build(Phases("throw and stay", (thrown, later))).run()
    assert found.message.startswith("phase 'throw': between the nodes, constraint 'ceiling'")


GROUND_AT_END = Constraint("ground", H, 0, 0, at="terminal")


def test_the_referee_sees_a_link_that_is_missed():
    found = solve(hop(), Collocation(10)).or_raise()
    x = found.whole.x.copy()
    x[0, 3] += 0.5  # the speed that the rise starts with
    normal = found.whole.normal
    assert normal is not None
    moved = PhasesSolution(found.side, found.whole.with_(x=x, normal=None))
    verdict = evaluate(moved)
    assert verdict.violation > 0.4
    assert verdict.links[0] == pytest.approx([0.0, 0.5], abs=1e-6)
    assert verdict.cost_error > 0.1
    later = hop(total=None, phases=(FALL, phase("later", x0=[0, 3], horizon=0.5)))
    found = solve(later, Collocation(10)).or_raise()
    x = found.whole.x.copy()
    x[0, 2] += 0.5
    verdict = evaluate(PhasesSolution(found.side, found.whole.with_(x=x, normal=None)))
    assert verdict.worst == "the link: the start of height in phase 'later'"


def test_a_start_of_the_first_phase_outside_its_bounds():
    bounded = replace(FALL, state_bounds=Box([-0.1, -9], [2, 9]))
    found = MultipleShooting(10).build(hop(phases=(bounded, RISE))).run(x0=[3.0, 0.0])
    assert found.status is Status.INFEASIBLE
    assert "phase 'fall'" in found.message
