"""Phases with links and resets against closed forms, uncut problems and each other."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

from ocp import (
    OCP,
    Box,
    Constraint,
    Link,
    Model,
    Parameter,
    Phases,
    PhasesSolution,
    Signal,
    Soft,
    Status,
    Unknown,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import Collocation, IndirectShooting, MultipleShooting, polish
from tests.phases.problems import (
    BALL,
    BOUNCE,
    FALL,
    RISE,
    H,
    T,
    U,
    V,
    cut_line,
    hop,
    hop_cost,
    line,
    phase,
    rocket,
)
from tests.tolerances import CERTIFIED, SAME_PROGRAM, STATIONARY

SOLVERS = [MultipleShooting(20), Collocation(10), IndirectShooting(5, steps=100)]
each_solver = pytest.mark.parametrize("solver", SOLVERS, ids=lambda s: type(s).__name__)


def best_hop() -> tuple[float, np.ndarray]:
    found = minimize(lambda z: hop_cost(*z), [-3.0, 0.7], method="BFGS", options={"gtol": 1e-9})
    return float(found.fun), found.x


@each_solver
def test_an_impact(solver):
    """Cost, speed and instant of a closed form; the costate of the speed jumps by the reset's."""
    cost, (speed, instant) = best_hop()
    found = solve(hop(), solver).or_raise()
    held = isinstance(solver, MultipleShooting)
    assert found.cost == pytest.approx(cost, rel=1e-3 if held else CERTIFIED)
    assert found.durations == pytest.approx([instant, 1.5 - instant], abs=2e-3 if held else 1e-6)
    fall, rise = found.phases
    assert fall.x[-1, 1] == pytest.approx(speed, abs=5e-3 if held else 1e-6)
    assert rise.x[0] == pytest.approx([0.0, -BOUNCE * fall.x[-1, 1]], abs=1e-9)
    assert fall.costate[-1, 1] == pytest.approx(-BOUNCE * rise.costate[0, 1], rel=1e-9)
    jump = rise.costate[0] - fall.costate[-1]
    assert list(found.jumps[0].values()) == pytest.approx(jump)
    assert (fall.t[-1], rise.t[-1]) == (rise.t[0], pytest.approx(1.5))
    verdict = evaluate(found)
    assert verdict.cost == pytest.approx(found.cost, rel=1e-9)
    assert sum(s.cost for s in found.phases) == pytest.approx(verdict.cost)
    assert verdict.violation < 1e-8
    assert verdict.stationarity is not None
    assert verdict.stationarity < STATIONARY


def test_costates_are_sensitivities_of_the_start():
    """Also across the impact: dJ*/dx0 against the closed form's differences."""
    program, step = Collocation(10).build(hop()), 1e-4
    found = program.run()
    for i, shift in enumerate(step * np.eye(2)):
        there, back = (program.run(x0=np.array([1.0, 0.0]) + s).cost for s in (shift, -shift))
        slope = (there - back) / (2 * step)
        assert found.phases[0].costate[0, i] == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize("solver", SOLVERS[:2], ids=lambda s: type(s).__name__)
def test_pieces_are_the_uncut_program(solver):
    """On the same grid, also from a later start: the clock goes on; costates do not jump."""
    program = replace(solver, intervals=3 * solver.intervals).build(line())
    uncut = program.run(t0=1.0).or_raise()
    found = solver.build(cut_line()).run(t0=1.0).or_raise()
    assert found.cost == pytest.approx(uncut.cost, rel=1e-10)
    x = np.vstack([found.phases[0].x, *[piece.x[1:] for piece in found.phases[1:]]])
    assert x == pytest.approx(uncut.x, abs=1e-7)
    assert max(abs(v) for jump in found.jumps for v in jump.values()) < 1e-7
    assert found.t == pytest.approx([1.0, 2.0, 3.0, 4.0])
    cut, whole = evaluate(found), evaluate(uncut)
    assert abs(cut.cost - whole.cost) <= cut.cost_error + whole.cost_error


@pytest.mark.slow  # two boundary value problems of 600 steps
def test_an_extremal_in_pieces():
    uncut = solve(line(), IndirectShooting(12, steps=600)).or_raise()
    found = solve(cut_line(), IndirectShooting(4, steps=200)).or_raise()
    assert found.cost == pytest.approx(uncut.cost, rel=1e-10)
    times = np.linspace(1.0, 2.0, 11)
    assert found.phases[1].control(times) == pytest.approx(uncut.control(times), abs=1e-8)
    assert found.phases[1].costate_at(times) == pytest.approx(uncut.costate_at(times), abs=1e-8)


@pytest.mark.slow  # until the cost holds to 1e-10
def test_pieces_are_polished_to_the_uncut_optimum():
    direct = MultipleShooting(20)
    uncut = polish(solve(line(), direct), accuracy=1e-10).or_raise()
    found = polish(solve(cut_line((1.0, 2.0)), direct), accuracy=1e-10)
    assert isinstance(found, PhasesSolution)
    assert found.status is Status.SOLVED
    assert found.cost == pytest.approx(uncut.cost, rel=CERTIFIED)
    assert found.phases[1].control(1.2) == pytest.approx(uncut.control(1.2), abs=1e-6)
    with pytest.raises(UnsupportedProblem, match="first: tank"):
        polish(solve(rocket(), Collocation(10)))


def test_a_stage_starts_with_a_mass_of_its_own():
    found = solve(rocket(), Collocation(20)).or_raise()
    first, second = found.phases
    assert first.x[-1, 2] == pytest.approx(0.7, abs=1e-6)
    assert second.x[0, 2] == 0.6
    assert second.x[0, :2] == pytest.approx(first.x[-1, :2], abs=1e-9)
    assert found["second"] is second
    assert list(found.jumps[0]) == ["height", "speed", "mass"]
    assert abs(found.jumps[0]["height"]) < 1e-9


def test_phases_of_different_models():
    """A cart of position and speed, then one whose speed is the input."""
    position, rate = ca.SX.sym("height"), ca.SX.sym("rate")
    slow = Model(name="slow", x=position, u=rate, f=rate)
    crawl = OCP(
        name="crawl",
        model=slow,
        x0=[0.5],
        horizon=1.0,
        running_cost=rate**2 / 2,
        terminal_cost=10 * position**2,
    )
    found = solve(Phases("two", (phase("fly", horizon=1.0), crawl)), Collocation(10)).or_raise()
    assert [s.x.shape[1] for s in found.phases] == [2, 1]
    assert found.phases[1].x[0, 0] == pytest.approx(found.phases[0].x[-1, 0], abs=1e-9)
    # Nothing wants a speed at the end of the first phase.
    assert found.phases[0].costate[-1, 1] == pytest.approx(0.0, abs=1e-7)


def test_a_constant_of_all_phases():
    """One gear for two phases costs what it does in the uncut problem, and has its sensitivity."""
    gear = ca.SX.sym("gear")
    geared = Model(name="geared", x=BALL.x, u=U, f=ca.vertcat(V, gear * U))
    uncut = phase(
        "uncut",
        model=geared,
        x0=[0, 0],
        horizon=1.0,
        terminal_cost=gear**2,
        constraints=(Constraint("end", BALL.x, [1, 0], [1, 0], at="terminal"),),
        unknowns=(Unknown("gear", gear, 1.0, 0.5, 1.5),),
    )
    whole = solve(uncut, Collocation(10)).or_raise()
    known = (Parameter("ratio", gear, 1.0),)
    pieces = (
        phase("start", model=geared, x0=[0, 0], horizon=0.4, parameters=known),
        replace(uncut, name="end", horizon=0.6, unknowns=(), parameters=known),
    )
    cut = Phases("geared", pieces, unknowns=(Unknown("gear", gear, 1.0, 0.5, 1.5),))
    found = solve(cut, Collocation(10)).or_raise()
    assert found.cost == pytest.approx(whole.cost, rel=CERTIFIED)
    assert found.unknowns["gear"] == pytest.approx(whole.unknowns["gear"], abs=1e-7)
    assert found.sensitivity["gear"] == pytest.approx(whole.sensitivity["gear"], rel=1e-5)
    assert found.phases[0].parameters["ratio"] == found.unknowns["gear"]
    assert evaluate(found).cost == pytest.approx(whole.cost, rel=CERTIFIED)


def test_terms_of_a_phase_come_back_in_its_terms():
    """An unknown constant, an integral and a soft constraint of one phase."""
    gear = ca.SX.sym("gear")
    geared = Model(name="geared", x=BALL.x, u=U, f=ca.vertcat(V, gear * U))
    budget = Constraint("budget", U**2, upper=4.0, at="integral")
    slow = Constraint("slow", V, upper=0.8, soft=Soft(5, 1))
    drive = phase(
        "drive",
        model=geared,
        x0=[0, 0],
        horizon=1.0,
        constraints=(budget, slow),
        terminal_cost=gear**2,
        unknowns=(Unknown("gear", gear, 1.0, 0.5, 2.0),),
    )
    free = replace(BALL, f=ca.vertcat(V, U))
    brake = phase("brake", model=free, x0=[1, 0], horizon=1.0, constraints=(TOP_AT_REST,))
    found = solve(Phases("trip", (drive, brake)), Collocation(20)).or_raise()
    first, second = found.phases
    assert set(first.unknowns) == {"gear"}
    assert first.x.shape[1] == second.x.shape[1] == 2
    assert first.multipliers["budget"].shape == (1,)
    assert first.slack["slow"].max() > 0.0
    verdict = evaluate(found)
    # Between its nodes a slack is held, an excess is not.
    assert verdict.cost == pytest.approx(found.cost, rel=1e-4)
    assert verdict.violation < 1e-5


TOP_AT_REST = Constraint("rest", BALL.x, [1.2, 0], [1.2, 0], at="terminal")


def test_signals_run_over_the_phase_that_has_them():
    wanted = ca.SX.sym("wanted")
    ramp, back = np.linspace(0, 1, 5), np.linspace(1, 0, 5)

    def follow(name: str, samples: np.ndarray, horizon: float) -> OCP:
        return phase(
            name,
            model=replace(BALL, f=ca.vertcat(V, U)),
            x0=[0, 0],
            horizon=horizon,
            running_cost=(H - wanted) ** 2 + 1e-3 * U**2,
            parameters=(Signal("wanted", wanted, samples, hold="linear"),),
        )

    cut = Phases("ramps", (follow("up", ramp, 1.0), follow("down", back, 1.0)))
    uncut = follow("both", np.concatenate([ramp, back[1:]]), 2.0)
    whole = solve(uncut, Collocation(16)).or_raise()
    found = solve(cut, Collocation(8)).or_raise()
    assert found.cost == pytest.approx(whole.cost, rel=1e-10)
    program = Collocation(8).build(cut)
    one = program.run(parameters={"wanted": np.ones(5)}).or_raise()
    both = Collocation(16).build(uncut).run(parameters={"wanted": np.ones(9)}).or_raise()
    assert one.cost == pytest.approx(both.cost, rel=1e-10)


def test_a_cycle_of_two_phases_is_a_period():
    """The last link leads to the first phase, whose start is then free."""
    lap = Constraint("lap", BALL.x - BALL.start, 0, 0, at="terminal")
    model = replace(BALL, f=ca.vertcat(V, U), t=T)
    cost = (H - ca.sin(np.pi * T)) ** 2 + 0.1 * U**2
    given = {"model": model, "running_cost": cost, "x0": [0.2, 0.1]}
    uncut = phase("lap", horizon=2.0, constraints=(lap,), free_start=model.x_names, **given)
    halves = tuple(phase(name, horizon=1.0, **given) for name in ("out", "home"))
    cycle = Phases("cycle", halves, (Link(), Link()))
    for solver in (Collocation(10), IndirectShooting(4, steps=80)):
        whole, found = solve(uncut, solver).or_raise(), solve(cycle, solver).or_raise()
        assert found.cost == pytest.approx(whole.cost, rel=1e-6)
        assert found.phases[1].x[-1] == pytest.approx(found.phases[0].x[0], abs=1e-8)


def test_equations_decide_what_they_contain():
    """Height plus speed goes on; the rest of the start is the phase's own, free or given."""
    later = phase("later", x0=[0.3, 0.4], horizon=1.0, free_start=("speed",))
    sums = BALL.x[0] + BALL.x[1] - BALL.start[0] - BALL.start[1]
    early = phase("early", horizon=1.0)
    found = solve(Phases("sums", (early, later), (Link(equations=sums),)), Collocation(8))
    found.or_raise()
    end, start = found.phases[0].x[-1], found.phases[1].x[0]
    assert start.sum() == pytest.approx(end.sum(), abs=1e-9)
    level = BALL.x[0] - BALL.start[0]
    found = solve(Phases("level", (early, later), (Link(equations=level),)), Collocation(8))
    assert found.phases[1].x[0, 0] == pytest.approx(found.phases[0].x[-1, 0], abs=1e-9)


def test_fixed_durations_need_no_unknown_and_free_ones_obey_the_total():
    fixed = hop(phases=(replace(FALL, horizon=0.7), replace(RISE, horizon=0.8)), total=None)
    found = solve(fixed, Collocation(8)).or_raise()
    assert found.durations.tolist() == [0.7, 0.8]
    some = solve(hop(total=Box(1.0, 1.4)), Collocation(8)).or_raise()
    assert some.durations.sum() == pytest.approx(1.0, abs=1e-6)
    free = solve(hop(total=None), Collocation(8)).or_raise()
    assert free.cost < some.cost


def test_both_backends_find_the_same():
    ipopt, fatrop = (
        solve(rocket(), MultipleShooting(15, backend=backend)) for backend in ("ipopt", "fatrop")
    )
    assert fatrop.or_raise().cost == pytest.approx(ipopt.or_raise().cost, rel=SAME_PROGRAM)


def test_a_reset_may_depend_on_time_and_parameters():
    lost = ca.SX.sym("lost")
    given = (Parameter("lost", lost, 0.2),)
    fall = replace(FALL, parameters=given, horizon=0.7)
    chain = hop(
        phases=(fall, replace(RISE, horizon=0.8)),
        links=(Link(ca.vertcat(H, -(1 - lost) * V)),),
        total=None,
    )
    program = Collocation(8).build(chain)
    same = solve(
        hop(phases=(replace(FALL, horizon=0.7), replace(RISE, horizon=0.8)), total=None),
        Collocation(8),
    )
    assert program.run().cost == pytest.approx(same.cost, rel=1e-9)
    harder = program.run(parameters={"lost": 0.5}).or_raise()
    assert harder.phases[1].x[0, 1] == pytest.approx(-0.5 * harder.phases[0].x[-1, 1])


def test_phases_that_share_nothing_but_time():
    """Each goes its own way from its own start; the total time is shared out between them."""
    near, far = (
        phase(
            name,
            model=replace(BALL, f=ca.vertcat(V, U)),
            x0=[0, 0],
            constraints=(Constraint("end", BALL.x, [d, 0], [d, 0], at="terminal"),),
        )
        for name, d in (("near", 1), ("far", 8))
    )
    found = solve(Phases("two ways", (near, far), (Link(states=()),), total=3.0), Collocation(8))
    # 6 d^2/T^3 each: durations are as the square roots of the distances.
    ratio = np.sqrt(8.0)
    assert found.durations == pytest.approx([3 / (1 + ratio), 3 * ratio / (1 + ratio)], abs=1e-5)
    assert evaluate(found).violation < 1e-7


def test_a_state_that_blows_up_is_judged_and_not_raised():
    wild = replace(FALL, name="wild", model=replace(BALL, f=ca.vertcat(V, V**3 + U)), x0=[1.0, 3.0])
    failed = solve(hop(phases=(wild, RISE)), MultipleShooting(5, max_iterations=1))
    assert not failed.status.is_success
    verdict = evaluate(failed)
    assert verdict.cost == np.inf or verdict.violation > 0.0
    assert not np.isnan([verdict.cost, verdict.cost_error, verdict.violation]).any()
