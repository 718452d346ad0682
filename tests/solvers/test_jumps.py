"""What derivatives do not see: jumps that a trajectory crosses, and kinks in a cost."""

import casadi as ca
import numpy as np
import pytest

from ocp import (
    OCP,
    Box,
    Constraint,
    Guess,
    Model,
    Parameter,
    ProblemError,
    Signal,
    UnsupportedProblem,
    evaluate,
    solve,
    without_kinks,
)
from ocp.internal import jumps_along
from solvers import (
    BetweenNodes,
    Collocation,
    IndirectShooting,
    MultipleShooting,
    diagnose,
    multistart,
)
from solvers.diagnose.finding import Severity
from solvers.internal import Cause

X, V, U = (ca.SX.sym(name) for name in "xvu")
FAR = 0.5
# Least integral of abs(u) from rest to rest over the distance 1 in 1 s with abs(u) <= 6: full
# thrust for a time d, coasting, full brake for d, where 6 d (1 - d) = 1.
FUEL = 12 * (1 - np.sqrt(1 - 4 / 6)) / 2


def ride(pull, cost=U**2, **changes) -> OCP:
    body = Model(name="body", x=ca.vertcat(X, V), u=U, f=ca.vertcat(V, U + pull))
    given = {
        "name": "ride",
        "model": body,
        "x0": [0.01, 0.0],
        "horizon": 1.0,
        "running_cost": cost,
        "constraints": (Constraint("end", body.x, [1, 0], [1, 0], at="terminal"),),
        "smoothness": 0,
    }
    return OCP(**(given | changes))


JUMPS = {
    "other ground": -ca.if_else(X > FAR, 2.0, 0.1) * V,
    "compared the other way": ca.if_else(FAR < X, 0.3, 0.0),
    "two conditions": ca.if_else(ca.logic_and(X > FAR, V > 0), 0.3, 0.0),
    "sign": 0.3 * ca.sign(X - FAR),
    "floor": 0.3 * ca.floor(2 * X),
    "remainder": 0.3 * ca.fmod(X, FAR),
    "branch cut": 0.1 * ca.atan2(X - FAR, -1),
}
KINKS = {
    "abs": ca.fabs(X - FAR),
    "max": ca.fmax(X, FAR),
    "equal branches": ca.if_else(X > FAR, X - FAR, 0),
    "sign times its argument": ca.sign(X - FAR) * (X - FAR),
    "switch beyond reach": ca.if_else(X > 50.0, 1.0, 0.0),
    "nothing": 0.0,
}


@pytest.mark.many
@pytest.mark.parametrize("pull", JUMPS.values(), ids=list(JUMPS))
@pytest.mark.parametrize("solver", [MultipleShooting(30), Collocation(10)], ids=repr)
def test_a_jump_on_the_way_is_found(solver, pull):
    found = solve(ride(pull), solver)
    jump = jumps_along(found)[0]
    assert "v" in jump.what
    assert found.state(jump.t)[0] == pytest.approx(FAR, abs=0.02)
    assert jump.amount > 0.01
    assert "phase" in str(jump)


@pytest.mark.parametrize("pull", KINKS.values(), ids=list(KINKS))
def test_a_kink_is_no_jump(pull):
    assert jumps_along(solve(ride(pull), MultipleShooting(30))) == ()


def test_a_jump_in_the_cost_of_a_control():
    priced = ride(0.0, cost=U**2 + ca.if_else(U > 0, 1.0, 0.0))
    jumps = jumps_along(solve(priced, MultipleShooting(30)))
    assert [j.what for j in jumps] == ["the running cost"]
    assert jumps[0].amount == pytest.approx(1.0)


def test_only_solutions_are_looked_along():
    with pytest.raises(ProblemError):
        jumps_along(ride(0.0))  # pyright: ignore[reportArgumentType]


# -- kinks in a cost ----------------------------------------------------------------------------


def fuel(cost, **changes) -> OCP:
    return ride(0.0, cost, x0=[0.0, 0.0], control_bounds=Box(-6.0, 6.0), **changes)


@pytest.mark.parametrize("solver", [MultipleShooting(200), Collocation(50)], ids=repr)
def test_slack_controls_in_place_of_an_absolute_value(solver):
    found = solve(without_kinks(fuel(ca.fabs(U))), solver)
    assert found.status.is_success
    assert found.cost == pytest.approx(FUEL, rel=1e-3)


def test_a_slack_control_is_the_absolute_value():
    found = solve(without_kinks(fuel(ca.fabs(U))), MultipleShooting(100))
    np.testing.assert_allclose(np.abs(found.u[:, 0]), found.u[:, 1], atol=1e-5)


def test_maxima_minima_and_sums_are_written_without_kinks():
    for cost in (
        2 * ca.fmax(U, -U),
        -2 * ca.fmin(U, -U),
        ca.fabs(U) + ca.fmax(U, -U),
        ca.fmax(ca.fmax(U, -U), 0) * 2,
    ):
        found = solve(without_kinks(fuel(cost)), MultipleShooting(100))
        assert found.status.is_success
        assert found.cost == pytest.approx(2 * FUEL, rel=2e-3)


@pytest.mark.parametrize(
    ("cost", "said"),
    [(U**2 - ca.fabs(U), "negative"), (X * ca.fabs(U), "weight"), (ca.fmin(U, -U), "negative")],
    ids=str,
)
def test_what_is_not_convex_is_refused(cost, said):
    with pytest.raises(UnsupportedProblem, match=said):
        without_kinks(fuel(cost))


def test_what_is_convex_is_replaced_and_the_rest_stays():
    both = without_kinks(fuel(ca.fabs(U) + ca.fmax(V - 1, 0) ** 2, smoothness=1))
    assert both.model.nu == 2
    assert both.smoothness == 1
    assert without_kinks(fuel(ca.fabs(U))).smoothness == 2


@pytest.mark.many
@pytest.mark.parametrize(
    "solver",
    [
        MultipleShooting(100),
        MultipleShooting(100, backend="fatrop"),
        Collocation(50),
        BetweenNodes(MultipleShooting(100)),
    ],
    ids=repr,
)
@pytest.mark.parametrize("smoothness", [0, 2])
def test_direct_solvers_replace_kinks_by_themselves(solver, smoothness):
    kinked = fuel(ca.fabs(U), smoothness=smoothness)
    found = solve(kinked, solver)
    assert found.status.is_success, found.message
    assert found.problem is kinked
    assert found.u.shape[1] == 1
    assert found.cost == pytest.approx(FUEL, rel=1e-3)
    assert evaluate(found).cost == pytest.approx(FUEL, rel=1e-3)


def test_a_kink_is_solved_from_any_guess():
    kinked = fuel(ca.fabs(U))
    guesses = [
        Guess(u=[0.0]),
        Guess(x=[[0, 0], [1, 0]], u=[[6.0], [-6.0]]),
        solve(kinked, Collocation(20)),
    ]
    for guess in guesses:
        found = solve(kinked, MultipleShooting(100), guess=guess)
        assert found.cost == pytest.approx(FUEL, rel=1e-3)
    best = multistart(kinked, MultipleShooting(100), starts=3, seed=0)
    assert [optimum.found for optimum in best] == [3]


def test_a_price_may_change_its_sign_from_run_to_run():
    price = ca.SX.sym("price")
    asked = fuel(
        price * ca.fabs(U) + U**2, parameters=(Parameter("price", price, 1.0),), smoothness=0
    )
    program = MultipleShooting(40).build(asked)
    dear, paid = program.run(), program.run(parameters={"price": -0.5})
    assert dear.status.is_success
    assert dear.cost == pytest.approx(evaluate(dear).cost)
    assert paid.cost == pytest.approx(evaluate(paid).cost)
    assert paid.cost < program.run(parameters={"price": 0.0}).cost < dear.cost


def test_a_weight_that_time_turns_around_keeps_its_kink() -> None:
    """At t0 = 3.3 s the sine is negative: a slack would sink for ever."""
    t = ca.SX.sym("t")
    body = Model(name="body", x=X, u=U, f=U, t=t)
    asked = OCP(
        name="timely",
        model=body,
        x0=[0.0],
        horizon=1.0,
        running_cost=ca.sin(t) * ca.fabs(U - 0.3) + U**2,
        control_bounds=Box(-1.0, 1.0),
        smoothness=0,
    )
    found = MultipleShooting(20).build(asked).run(t0=3.3)
    assert found.cost == pytest.approx(evaluate(found).cost)
    assert np.isfinite(found.cost)


@pytest.mark.parametrize("solver", [MultipleShooting(100), Collocation(30)], ids=repr)
def test_a_weight_that_grows_with_time_is_replaced(solver) -> None:
    t = ca.SX.sym("t")
    body = Model(name="body", x=X, u=U, f=U, t=t)
    asked = OCP(
        name="dearer and dearer",
        model=body,
        x0=[1.0],
        horizon=3.0,
        running_cost=(1 + t / 3) * ca.fabs(U) + U**2 + X**2,
        control_bounds=Box(-1.0, 1.0),
        smoothness=0,
    )
    found = solve(asked, solver)
    assert found.status.is_success, found.message
    assert found.cost == pytest.approx(evaluate(found).cost, rel=1e-4)


@pytest.mark.many
@pytest.mark.parametrize("hold", ["held", "linear"])
def test_a_price_that_is_negative_for_a_sample_keeps_its_kink(hold) -> None:
    price, samples = ca.SX.sym("price"), np.ones((42, 1))
    asked = fuel(
        price * ca.fabs(U) + U**2,
        parameters=(Signal("price", price, samples, hold=hold),),
        smoothness=0,
    )
    program = MultipleShooting(82).build(asked)
    samples = samples.copy()
    samples[17] = -0.5
    for given in (np.ones((42, 1)), samples):
        found = program.run(parameters={"price": given})
        assert np.isfinite(found.cost)
        assert found.cost == pytest.approx(evaluate(found).cost, rel=1e-3)


def test_names_and_sizes_of_the_user_are_no_obstacle() -> None:
    named = Constraint("slack 0", X, -9.0, 9.0)
    plain = fuel(ca.fabs(U))
    sized = fuel(
        ca.fabs(U),
        model=Model(name="body", x=plain.model.x, u=U, f=plain.model.f, u_nominal=2.0),
        constraints=(*plain.constraints, named),
    )
    assert solve(sized, MultipleShooting(50)).cost == pytest.approx(FUEL, rel=1e-2)


@pytest.mark.slow
def test_what_a_held_slack_cannot_follow_stays_as_it_is():
    """A slack that is held misses the integral of abs(x), so only Collocation replaces it."""
    asked = ride(0.0, ca.fabs(X - FAR) + 1e-2 * U**2)
    direct, collocated = solve(asked, MultipleShooting(100)), solve(asked, Collocation(50))
    for found in (direct, collocated):
        assert found.status.is_success, found.message
        assert found.cost == pytest.approx(evaluate(found).cost, rel=1e-3)
    assert direct.cost == pytest.approx(collocated.cost, rel=1e-2)


def test_a_discrete_problem_priced_by_absolute_values():
    """From x = 1 with a price of 0.2 on abs(u) and 1 on abs(x): full steps as far as they pay."""
    plain = Model(name="integrator", x=X, u=U, f=X + 0.25 * U, dt=1.0)
    asked = OCP(
        name="prices",
        model=plain,
        x0=[1.0],
        horizon=6,
        running_cost=ca.fabs(X) + 0.2 * ca.fabs(U),
        control_bounds=Box(-1.0, 1.0),
    )
    found = solve(asked, MultipleShooting())
    assert found.status.is_success, found.message
    np.testing.assert_allclose(found.u.ravel(), [-1, -1, -1, -1, 0, 0], atol=1e-5)
    assert found.cost == pytest.approx(1 + 0.75 + 0.5 + 0.25 + 0.8, rel=1e-6)


def test_nothing_to_replace():
    with pytest.raises(ProblemError, match="no absolute value"):
        without_kinks(fuel(U**2))


@pytest.mark.slow
def test_the_advice_on_a_kink_leads_on():
    for smoothness in (0, 2):
        kinked = fuel(ca.fabs(U), smoothness=smoothness)
        first = diagnose(kinked).first
        assert first is not None
        assert first.cause is Cause.KINK
        assert "without_kinks" in first.sentence
    smooth = without_kinks(kinked)
    assert not diagnose(smooth).serious
    best = multistart(smooth, MultipleShooting(100), starts=3, seed=0)[0]
    assert best.cost == pytest.approx(FUEL, rel=1e-3)


def test_indirect_methods_refuse_a_kink_in_the_control():
    with pytest.raises(UnsupportedProblem, match="kink in a control"):
        solve(fuel(ca.fabs(U) + U**2), IndirectShooting(segments=5))
    smooth = fuel(ca.fmax(U, 0.0) ** 2 + U**2)
    IndirectShooting(segments=5).build(smooth)


# -- no error where there is an answer ----------------------------------------------------------


@pytest.mark.slow
def test_a_force_that_keeps_a_length_is_no_free_control():
    x, y, a, b, rod, f = (ca.SX.sym(name) for name in ("x", "y", "a", "b", "rod", "f"))
    bob = Model(
        name="pendulum",
        x=ca.vertcat(x, y, a, b),
        u=ca.vertcat(f, rod),
        f=ca.vertcat(a, b, f - rod * x, -1 - rod * y),
    )
    swing = OCP(
        name="swing",
        model=bob,
        x0=[0.0, -1.0, 0.0, 0.0],
        horizon=2.0,
        running_cost=f**2,
        constraints=(
            Constraint("length", x**2 + y**2, 1.0, 1.0),
            Constraint("end", ca.vertcat(x, a), [0.8, 0.0], [0.8, 0.0], at="terminal"),
        ),
    )
    assert not diagnose(swing).serious


@pytest.mark.slow
def test_a_constraint_whose_slope_vanishes_at_zero_is_no_contradiction():
    c, s = ca.SX.sym("c"), ca.SX.sym("s")
    ship = Model(name="ship", x=ca.vertcat(X, V), u=ca.vertcat(c, s), f=ca.vertcat(c, s))
    thrust = OCP(
        name="unit thrust",
        model=ship,
        x0=[0.0, 0.0],
        horizon=1.0,
        terminal_cost=-X,
        constraints=(Constraint("unit", c**2 + s**2, 1.0, 1.0),),
    )
    assert not [f for f in diagnose(thrust).findings if f.severity is Severity.ERROR]


def test_a_stationary_start_is_told_from_an_optimum():
    cubic = Model(name="cubic", x=ca.vertcat(X, V), u=U, f=ca.vertcat(V, U**3))
    asked = OCP(
        name="cubic thrust",
        model=cubic,
        x0=[1.0, 0.0],
        horizon=8.0,
        running_cost=X**2 + V**2 + U**2,
        control_bounds=Box(-1.0, 1.0),
    )
    causes = [f.cause for f in diagnose(asked).findings]
    assert Cause.NO_GOAL not in causes
