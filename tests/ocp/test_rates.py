"""Rates of controls: problems augmented by hand, closed forms, the referee, bad input."""

import pickle
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad

from ocp import (
    OCP,
    Box,
    Constraint,
    Guess,
    Model,
    Parameter,
    ProblemError,
    Rate,
    Soft,
    Solution,
    Status,
    Unknown,
    UnsupportedProblem,
    discretise,
    evaluate,
    linear_quadratic,
    solve,
)
from ocp.internal import normal_form
from solvers import (
    AugmentedLagrangian,
    BetweenNodes,
    Collocation,
    IndirectShooting,
    LinearMPC,
    MultipleShooting,
    Riccati,
    Schuetz,
    StagewiseNewton,
    certify,
    diagnose,
    multistart,
    polish,
)
from tests.ocp.mass import ARRIVAL, MASS, pushed
from tests.ocp.mass import FORCE as F
from tests.ocp.mass import POSITION as P
from tests.ocp.mass import TIME as T
from tests.ocp.mass import VELOCITY as V

STEPS = replace(MASS, name="steps", f=ca.vertcat(P + 0.1 * V, V + 0.1 * F), dt=0.1)


def mass(**changes: Any) -> OCP:
    rated = {"rates": (Rate(F, -60, 60, weight=0.01),), "last_input": [0.5]}
    return pushed(**(rated | changes))


def steps(**changes: Any) -> OCP:
    given: dict[str, Any] = {
        "model": STEPS,
        "x0": [1.0, 0.0],
        "horizon": 20,
        "running_cost": P**2 + 0.1 * F**2,
        "constraints": (),
        "control_bounds": Box(-2, 2),
        "rates": (Rate(F, -0.3, 0.3, weight=0.05),),
    }
    return mass(**(given | changes))


DIRECT = [MultipleShooting(20), Collocation(8)]

# -- the same as augmented by hand ----------------------------------------------------------------


@pytest.mark.parametrize("solver", DIRECT, ids=repr)
def test_a_rate_is_the_control_of_a_larger_state(solver):
    """Control bounds are state bounds then; the last input is a part of the start."""
    r = ca.SX.sym("r")
    by_hand = OCP(
        name="by hand",
        model=Model(name="m", x=ca.vertcat(MASS.x, F), u=r, f=ca.vertcat(MASS.f, r), t=T),
        x0=[0, 0, 0.5],
        horizon=1.0,
        running_cost=F**2 / 2 + 0.01 * r**2,
        control_bounds=Box(-60, 60),
        state_bounds=Box([-np.inf, -np.inf, -5.5], [np.inf, np.inf, 5.5]),
        constraints=(ARRIVAL,),
    )
    hand = solve(by_hand, solver).or_raise()
    found = solve(mass(control_bounds=Box(-5.5, 5.5)), solver).or_raise()
    assert found.cost == pytest.approx(hand.cost, rel=1e-12)
    np.testing.assert_allclose(found.x, hand.x[:, :2], atol=1e-10)
    np.testing.assert_allclose(found.costate, hand.costate[:, :2], atol=1e-6)
    np.testing.assert_allclose(found.control(found.t)[:, 0], hand.x[:, 2], atol=1e-10)
    assert found.sensitivity["last_input"] == pytest.approx(hand.costate[0, 2:], abs=1e-6)
    assert found.x0.shape == (2,)
    assert found.parameters["last_input"] == [0.5]


def test_in_discrete_time_what_was_sent_is_a_state():
    last = ca.SX.sym("last")
    change = Constraint("change", F - last, -0.3, 0.3)
    by_hand = OCP(
        name="by hand",
        model=replace(STEPS, x=ca.vertcat(STEPS.x, last), f=ca.vertcat(STEPS.f, F)),
        x0=[1, 0, 0.5],
        horizon=20,
        running_cost=P**2 + 0.1 * F**2 + 0.05 * (F - last) ** 2,
        control_bounds=Box(-2, 2),
        constraints=(change,),
    )
    for solver in (MultipleShooting(), LinearMPC()):
        hand, found = solve(by_hand, solver).or_raise(), solve(steps(), solver).or_raise()
        assert found.cost == pytest.approx(hand.cost, rel=1e-12)
        np.testing.assert_allclose(found.u, hand.u, atol=1e-9)
        assert found.sensitivity["last_input"] == pytest.approx(hand.costate[0, 2:], abs=1e-8)
        assert evaluate(found).cost == pytest.approx(found.cost, rel=1e-10)
        assert evaluate(found).violation < 1e-9


def test_one_control_of_two_beside_a_held_one():
    """Between the nodes one is a line and the other held: both are polynomials."""
    w = ca.SX.sym("w")
    both = replace(MASS, u=ca.vertcat(w, F), f=ca.vertcat(V + w, F))
    ocp = mass(model=both, running_cost=F**2 / 2 + w**2, rates=(Rate(F, weight=0.01),))
    shot = solve(ocp, MultipleShooting(40)).or_raise()
    assert (shot.control_kind, shot.u.shape) == ("polynomial", (80, 2))
    pieces = shot.pieces.coefficients
    np.testing.assert_array_equal(pieces[:, 0, 0], pieces[:, 1, 0])
    np.testing.assert_array_equal(pieces[1:, 0, 1], pieces[:-1, 1, 1])
    curved, exact = solve(ocp, Collocation(8)), solve(ocp, IndirectShooting(8))
    for found in (shot, curved, exact):
        verdict = evaluate(found)
        assert found.cost == pytest.approx(verdict.cost, rel=1e-6)
        assert verdict.violation < 1e-7
    assert shot.cost == pytest.approx(exact.cost, rel=1e-2)
    assert curved.cost == pytest.approx(exact.cost, rel=1e-5)
    assert curved.pieces.coefficients.shape == (8, 5, 2)


def test_two_controls_are_stacked_in_the_order_of_the_model():
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    model = Model(name="two", x=ca.vertcat(P, V), u=ca.vertcat(a, b), f=ca.vertcat(a, b))
    ocp = mass(
        model=model,
        running_cost=0,
        constraints=(),
        terminal_cost=-P - V,
        rates=(Rate(ca.vertcat(b, a), [-2, -1], [2, 1]),),
        last_input=[10, 20],
    )
    found = solve(ocp, MultipleShooting(5)).or_raise()
    np.testing.assert_allclose(found.u[0], [10, 20])
    np.testing.assert_allclose(found.u[-1], [11, 22], atol=1e-6)
    assert found.sensitivity["last_input"] == pytest.approx([-1, -1], abs=1e-7)


# -- closed forms ---------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", [*DIRECT, IndirectShooting(8)], ids=repr)
def test_the_least_jerk_over_a_way(solver):
    """r = 160 s^2 - 120 s with s = 1 - t: the integral of r^2 is 320, and dJ/d(last) = -2 r(0)."""
    ocp = mass(running_cost=0.0, rates=(Rate(F, weight=1.0),), last_input=[0.0])
    found = solve(ocp, solver).or_raise()
    tight = not isinstance(solver, MultipleShooting)
    assert evaluate(found).cost == pytest.approx(320.0, rel=1e-8 if tight else 1e-2)
    assert found.sensitivity["last_input"] == pytest.approx([-80.0], rel=1e-7 if tight else 2e-2)


@pytest.mark.parametrize("solver", DIRECT, ids=repr)
def test_as_far_as_a_rate_allows(solver):
    """A ramp of 4 N/s from 0 to the bound of 2 N, which it reaches in the middle: 7/12 m."""
    ocp = mass(
        running_cost=0,
        terminal_cost=-P,
        constraints=(),
        rates=(Rate(F, -4, 4),),
        last_input=[0.0],
        control_bounds=Box(-2, 2),
    )
    found = solve(ocp, solver).or_raise()
    assert evaluate(found).cost == pytest.approx(-7 / 12, rel=1e-6)
    unbounded = solve(replace(ocp, control_bounds=Box()), solver).or_raise()
    assert evaluate(unbounded).cost == pytest.approx(-4 / 6, rel=1e-6)
    assert unbounded.sensitivity["last_input"] == pytest.approx([-0.5], rel=1e-6)


def test_indirect_and_direct_agree():
    ocp = mass(rates=(Rate(F, weight=0.01),))
    exact = polish(solve(ocp, MultipleShooting(20))).or_raise()
    fine = solve(ocp, Collocation(30)).or_raise()
    assert exact.status is Status.SOLVED
    assert evaluate(exact).cost == pytest.approx(evaluate(fine).cost, rel=1e-8)
    np.testing.assert_allclose(exact.costate[0], fine.costate[0], rtol=1e-6)
    np.testing.assert_allclose(exact.control(fine.t), fine.control(fine.t), atol=1e-6)


@pytest.mark.slow
def test_a_problem_with_rates_is_certified():
    certificate = certify(solve(mass(rates=(Rate(F, weight=0.01),)), MultipleShooting(20)))
    assert certificate.holds, str(certificate)


def test_a_last_input_that_is_free_costs_nothing():
    given, free = mass(), mass(last_input=None)
    for solver in DIRECT:
        cheaper = solve(free, solver).or_raise()
        assert cheaper.cost < solve(given, solver).cost
        assert cheaper.sensitivity["last_input"] == pytest.approx([0.0], abs=1e-6)
        assert "last_input" not in cheaper.parameters
    found = solve(steps(last_input=None), MultipleShooting()).or_raise()
    assert found.u[0, 0] < -0.3
    assert evaluate(found).cost == pytest.approx(found.cost, rel=1e-9)


@pytest.mark.parametrize("ocp", [mass(), steps()], ids=["continuous", "discrete"])
def test_the_sensitivity_is_the_slope_of_the_cost(ocp):
    program, h = MultipleShooting(20).build(ocp), 1e-3
    costs = [program.run(parameters={"last_input": [0.5 + d]}).cost for d in (-h, h)]
    slope = (costs[1] - costs[0]) / (2 * h)
    assert program.run().sensitivity["last_input"][0] == pytest.approx(slope, rel=1e-5)


@pytest.mark.slow
def test_beside_every_other_term_of_the_normal_form():
    k = ca.SX.sym("k")
    ocp = mass(
        terminal_cost=(k - 1) ** 2,
        model=replace(MASS, f=ca.vertcat(V, k * F)),
        unknowns=(Unknown("gain", k, 1.0, 0.5, 1.5),),
        constraints=(
            ARRIVAL,
            Constraint("budget", F**2, upper=11.0, at="integral"),
            Constraint("slow", V, upper=1.4, soft=Soft(5.0)),
        ),
        free_start=("velocity",),
        start_bounds=Box([-np.inf, 0], [np.inf, 0.2]),
    )
    found = solve(ocp, Collocation(12)).or_raise()
    assert found.multipliers["budget"] >= 0
    assert found.slack["slow"].shape == (len(found.t) - 1, 1)
    # A slack that is held between the points costs a little more than the excess itself.
    assert evaluate(found).cost == pytest.approx(found.cost, rel=1e-3)
    guess = Guess(x=[[0, 0], [1, 0]], u=[[1.0], [-1.0]])
    again = solve(ocp, Collocation(12), guess=guess)
    assert again.cost == pytest.approx(found.cost, rel=1e-6)
    assert solve(ocp, MultipleShooting(30), guess=found).status.is_success


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_change_nothing(unit):
    """The same mass with forces in another unit: it is scaled inside."""
    scaled = mass(
        model=replace(MASS, f=ca.vertcat(V, F * unit)),
        running_cost=(F * unit) ** 2 / 2,
        rates=(Rate(F, -30 / unit, 30 / unit, weight=0.01 * unit**2),),
        last_input=[0.5 / unit],
    )
    for solver in DIRECT:
        found, plain = solve(scaled, solver), solve(mass(rates=(Rate(F, -30, 30, 0.01),)), solver)
        assert found.status.is_success, found.message
        assert found.cost == pytest.approx(plain.cost, rel=1e-7)
        assert evaluate(found).cost == pytest.approx(evaluate(plain).cost, rel=1e-7)


# -- the referee ----------------------------------------------------------------------------------


def by_hand(ocp: OCP, **changes: Any) -> Solution:
    given: dict[str, Any] = {
        "problem": ocp,
        "solver": "by hand",
        "status": Status.SOLVED,
        "t": np.linspace(0, 1, 3),
        "x": np.zeros((3, 2)),
        "x0": np.zeros(2),
        "costate": np.zeros((3, 2)),
        "u": np.array([[0.5], [0.5]]),
        "cost": 0.0,
        "parameters": {"last_input": np.array([0.5])},
    }
    return Solution(**(given | changes))


def test_a_held_control_that_jumps_has_an_infinite_rate():
    plain = mass(constraints=())
    still = evaluate(by_hand(plain))
    assert (still.violation, still.cost) == (0.0, pytest.approx(0.125))
    jumping = evaluate(by_hand(plain, u=np.array([[0.5], [0.7]])))
    assert (jumping.violation, jumping.worst) == (np.inf, "bound of rate of force at t = 0.5 s")
    assert jumping.cost == np.inf
    late = evaluate(by_hand(plain, u=np.array([[0.7], [0.7]])))
    assert late.worst == "bound of rate of force at t = 0 s"
    priced = evaluate(by_hand(replace(plain, rates=(Rate(F, weight=1.0),)), u=np.ones((2, 1))))
    assert (priced.violation, priced.cost) == (0.0, np.inf)
    assert "jumps" in priced.worst
    upwards = replace(plain, rates=(Rate(F, lower=-1.0),))
    assert evaluate(by_hand(upwards, u=np.ones((2, 1)))).violation == 0.0


def test_the_rate_of_a_line_and_of_a_polynomial():
    plain = mass(constraints=(), running_cost=0, rates=(Rate(F, -1, 1, weight=2.0),))
    line = evaluate(by_hand(plain, control_kind="linear", u=np.array([[0.5], [1.5], [1.0]])))
    assert line.violation == pytest.approx(1.0)
    assert line.cost == pytest.approx(2.0 * (2.0**2 + 1.0**2) / 2)
    c = np.array([[0.5, 0.9, 0.4, 1.0], [1.0, 1.3, 1.2, 0.2]])
    curve = by_hand(
        plain, control_kind="polynomial", u=c.reshape(-1, 1), breaks=np.array([0, 1, 2])
    )

    def rate(t: float) -> float:
        return float((curve.control(t + 1e-6) - curve.control(t - 1e-6))[0] / 2e-6)

    cost = sum(quad(lambda t: 2.0 * rate(t) ** 2, a, a + 0.5 - 2e-6)[0] for a in (1e-6, 0.5 + 1e-6))
    assert evaluate(curve).cost == pytest.approx(cost, rel=1e-4)
    fine = np.linspace(1e-5, 1 - 1e-5, 4001)
    largest = max(abs(rate(t)) for t in fine)
    assert evaluate(curve).violation == pytest.approx(largest - 1.0, rel=1e-2)


def test_a_change_per_step_is_judged_from_the_last_input_on():
    plain = steps(horizon=2)
    u = np.array([[0.5], [1.0]])
    verdict = evaluate(by_hand(plain, u=u, t=np.array([0, 0.1, 0.2])))
    assert (verdict.violation, verdict.worst) == (
        pytest.approx(0.2),
        "bound of rate of force at t = 0.1 s",
    )
    assert verdict.cost == pytest.approx(
        0.1 * (0.5**2 + 1.0**2) + 0.05 * 0.5**2 + 0.05**2**0 * 0.0025, rel=1
    )
    jumped = evaluate(
        by_hand(plain, u=u, t=np.array([0, 0.1, 0.2]), parameters={"last_input": np.array([-0.5])})
    )
    assert jumped.worst == "bound of rate of force at t = 0 s"


# -- files, text, and the other tools -------------------------------------------------------------


def test_it_is_kept_in_files_copies_and_words(tmp_path):
    ocp = mass()
    found = solve(ocp, MultipleShooting(10)).or_raise()
    for copy in (pickle.loads(pickle.dumps(found)), Solution.load(found.save(tmp_path / "s"), ocp)):
        assert evaluate(copy).cost == evaluate(found).cost
        assert copy.sensitivity == found.sensitivity
    with pytest.raises(ProblemError, match="rates differ"):
        Solution.load(tmp_path / "s.npz", mass(rates=(Rate(F, -60, 61, weight=0.01),)))
    assert "-60 <= d(force)/dt <= 60   (at 0.01 (d(force)/dt)^2, last input 0.5)" in ocp.describe()
    assert "-0.3 <= force[k] - force[k-1] <= 0.3   (at 0.05" in steps().describe()
    assert "last input free" in mass(last_input=None).describe()
    assert found.plot().axes


@pytest.mark.slow
def test_the_other_tools_speak_of_the_rate():
    tight = mass(rates=(Rate(F, -1, 1),))
    assert "rate of force" in str(diagnose(tight))
    assert not solve(tight, MultipleShooting(10)).status.is_success
    optima = multistart(mass(), MultipleShooting(10), 3, 0)
    assert optima[0].found == 3
    assert optima[0].solution.u.shape == (11, 1)
    held = BetweenNodes(MultipleShooting(20))
    assert solve(mass(control_bounds=Box(-5.5, 5.5)), held).status.is_success


# -- what is refused ------------------------------------------------------------------------------


def test_methods_say_what_they_do_not_take():
    bounded = mass(control_bounds=Box(-7, 7), constraints=(), terminal_cost=(P - 1) ** 2)
    said = r"takes no state bounds \('force'\), which the bounds of a control with a Rate are"
    for solver in (IndirectShooting(5), StagewiseNewton(5), Schuetz(5)):
        with pytest.raises(UnsupportedProblem, match=said):
            solver.build(bounded)
    found = solve(bounded, AugmentedLagrangian(StagewiseNewton(20)))
    assert found.cost == pytest.approx(solve(bounded, MultipleShooting(20)).cost, rel=1e-6)
    with pytest.raises(UnsupportedProblem, match="rate of force"):
        Riccati().build(steps(control_bounds=Box()))
    weighed = steps(control_bounds=Box(), rates=(Rate(F, weight=0.05),))
    exact = solve(weighed, MultipleShooting())
    assert solve(weighed, Riccati()).cost == pytest.approx(exact.cost, rel=1e-9)
    with pytest.raises(UnsupportedProblem, match=r"free start \('last force'\)"):
        LinearMPC().build(steps(last_input=None))
    with pytest.raises(UnsupportedProblem, match="rate of force is no part of A, B, Q, R"):
        linear_quadratic(steps())
    with pytest.raises(UnsupportedProblem, match="held controls jump"):
        discretise(mass(), 0.1)


WRONG = {
    "which is no control; they are force": {"rates": (Rate(V, -1, 1),)},
    "two rates of 'force'": {"rates": (Rate(F, -1, 1), Rate(F, weight=1))},
    r"last_input\[0\] = 9.0 is outside the bounds of force": {
        "control_bounds": Box(-7, 7),
        "last_input": [9.0],
    },
    "no control has a Rate": {"rates": ()},
    "last_input has shape|last_input": {"last_input": [1.0, 2.0]},
    "last_input": {"last_input": [np.nan]},
    "an entry of rates": {"rates": (Box(),)},
    "two parameters are called 'last_input'": {
        "parameters": (Parameter("last_input", ca.SX.sym("k"), 1.0),)
    },
}


@pytest.mark.parametrize("said", WRONG)
def test_what_does_not_fit_the_problem_is_refused(said):
    with pytest.raises(ProblemError, match=said):
        mass(**WRONG[said])


def test_a_rate_without_sense_is_refused():
    for said, make in (
        ("weight = .* must be 0 or more", lambda: Rate(F, weight=-1)),
        ("no number lies between 2", lambda: Rate(F, 2, 1)),
        ("rate of force: neither a bound nor a weight", lambda: Rate(F)),
        ("rate of b: neither", lambda: Rate(ca.vertcat(F, ca.SX.sym("b")), weight=[1, 0])),
        ("Rate: control", lambda: Rate(2 * F, -1, 1)),
        ("weight", lambda: Rate(F, weight=np.nan)),
    ):
        with pytest.raises(ProblemError, match=said):
            make()
    twin = Model(name="twin", x=ca.vertcat(P, ca.SX.sym("force")), u=F, f=ca.vertcat(F, F))
    with pytest.raises(ProblemError, match="another symbol is called so"):
        mass(model=twin)


def test_runs_refuse_a_last_input_that_does_not_fit():
    program = MultipleShooting(10).build(mass(control_bounds=Box(-7, 7)))
    with pytest.raises(ProblemError, match="has 2 entries, 1 are needed"):
        program.run(parameters={"last_input": [1, 2]})
    outside = program.run(parameters={"last_input": [8.0]})
    assert outside.status is Status.INFEASIBLE
    assert "bound of force is violated by 1 at t = 0 s" in outside.message
    with pytest.raises(ProblemError, match="unknown parameters: last_input"):
        MultipleShooting(10).build(mass(last_input=None)).run(parameters={"last_input": [1]})


def test_a_problem_without_rates_is_as_it_was():
    plain = mass(rates=(), last_input=None)
    assert normal_form(plain) is None
    assert plain.entries == ()
