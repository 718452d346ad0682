"""Soft constraints: prices of every kind, by every kind of method, in a loop, and bad input."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    Guess,
    InputSource,
    Model,
    Plant,
    ProblemError,
    Soft,
    UnsupportedProblem,
    discretise,
    evaluate,
    solve,
)
from ocp.internal import normal_form
from solvers import (
    BetweenNodes,
    Collocation,
    IndirectShooting,
    LinearMPC,
    MultipleShooting,
    polish,
)
from tests.ocp.mass import ARRIVAL, MASS, pushed
from tests.ocp.mass import FORCE as U
from tests.ocp.mass import POSITION as X
from tests.ocp.mass import VELOCITY as V


def transfer(soft: Soft | None, **changes: Any) -> OCP:
    """From rest to rest in 1 s, at most 1.2 m/s fast if that is worth it (without: 1.5 m/s)."""
    given = {
        "name": "transfer",
        "constraints": (ARRIVAL, Constraint("slow", V, -3, 1.2, soft=soft)),
    }
    return pushed(**(given | changes))


# The hard limit in closed form: parabolic ramps of a seconds, 4 a h/3 + (1 - 2 a) h = 1 with
# h = 1.2, and the force 2 h/a (1 - t/a) along them.
RAMP = 1.5 * (1 - 1 / 1.2)
HARD = 4 * 1.2**2 / (3 * RAMP)


@pytest.mark.parametrize(
    "solver",
    [MultipleShooting(50), MultipleShooting(50, backend="fatrop"), Collocation(25)],
    ids=repr,
)
class TestDirect:
    def test_above_the_multiplier_a_linear_price_is_exact(self, solver):
        found = solve(transfer(Soft(linear=100)), solver).or_raise()
        hard = solve(transfer(None), solver).or_raise()
        assert found.cost == pytest.approx(hard.cost, rel=1e-6)
        assert found.slack["slow"].max() < 1e-6

    @pytest.mark.many
    @pytest.mark.parametrize("soft", [Soft(10), Soft(5, 20), Soft(quadratic=100)])
    def test_below_it_gives_way_and_costs_what_the_referee_says(self, solver, soft):
        found = solve(transfer(soft), solver).or_raise()
        verdict = evaluate(found)
        assert 0.01 < found.slack["slow"].max() < 0.3
        assert found.slack["slow"].shape == (len(found.t) - 1, 1)
        assert verdict.cost == pytest.approx(found.cost, rel=2e-3)
        assert verdict.cost < HARD
        assert verdict.violation == pytest.approx(0.0, abs=1e-7)

    @pytest.mark.many
    @pytest.mark.parametrize(
        # Below the multiplier of the hard end, 12, the position pulls by w = 3: it gets w/12 far.
        ("soft", "cost", "left"),
        [
            (Soft(3), 2.625, 0.75),
            (Soft(1000), 6.0, 0.0),
            # u = (1 - t) a + b with prices -10 (x - 1) and -10 v at the end.
            (Soft(quadratic=5), 165 / 68, 33 / 68),
        ],
    )
    def test_an_end_may_be_missed_at_a_price(self, solver, soft, cost, left):
        end = Constraint("arrival", MASS.x, [1, 0], [1, 0], at="terminal", soft=soft)
        found = solve(transfer(None, constraints=(end,)), solver).or_raise()
        assert evaluate(found).cost == pytest.approx(cost, rel=1e-3)
        assert found.slack["arrival"][0] == pytest.approx(left, abs=1e-3)


@pytest.mark.slow
def test_two_transcriptions_agree_with_the_shape_of_the_optimum():
    direct = solve(transfer(Soft(10)), MultipleShooting(400)).or_raise()
    assert evaluate(direct).cost == pytest.approx(
        evaluate(solve(transfer(Soft(10)), Collocation(100))).cost, rel=1e-4
    )


def test_a_quadratic_price_needs_no_slack_and_is_solved_indirectly():
    ocp = transfer(Soft(quadratic=100))
    form = normal_form(ocp)
    assert form is not None
    assert form.problem.model.nu == 1
    assert form.problem.smoothness == 1
    direct = solve(ocp, Collocation(60)).or_raise()
    exact = solve(ocp, IndirectShooting(10), guess=direct).or_raise()
    assert evaluate(exact).cost == pytest.approx(evaluate(direct).cost, rel=1e-6)
    assert polish(direct).cost == pytest.approx(exact.cost, rel=1e-6)


def test_rows_have_their_own_prices():
    both = Constraint(
        "both", ca.vertcat(V, U), [-3, -4], [1.2, 4], soft=Soft(linear=[10, 0], quadratic=[0, 50])
    )
    ocp = transfer(None, constraints=(ARRIVAL, both))
    found = solve(ocp, Collocation(25)).or_raise()
    assert found.slack["both"].shape == (len(found.t) - 1, 2)
    assert (found.slack["both"].max(axis=0) > 1e-3).all()
    assert evaluate(found).cost == pytest.approx(found.cost, rel=1e-3)


def test_what_costs_is_not_held_between_nodes():
    with pytest.raises(UnsupportedProblem, match="'slow' is soft"):
        solve(transfer(Soft(10)), BetweenNodes(MultipleShooting(30)))


def test_units_do_not_matter():
    size = 1e5
    far = Constraint("arrival", MASS.x, [size, 0], [size, 0], at="terminal")
    slow = Constraint("slow", V, -3 * size, 1.2 * size, soft=Soft(10 * size))
    found = solve(transfer(None, constraints=(far, slow)), Collocation(25)).or_raise()
    near = solve(transfer(Soft(10)), Collocation(25)).or_raise()
    assert found.cost / size**2 == pytest.approx(near.cost, rel=1e-5)


def regulator(soft: Soft, *, dt: float | None = None) -> OCP:
    f = ca.vertcat(V, U) if dt is None else ca.vertcat(X + dt * V, V + dt * U)
    return OCP(
        name="regulator",
        model=Model(name="mass", x=MASS.x, u=U, f=f, dt=dt),
        x0=[2.0, 0.0],
        horizon=2.0 if dt is None else 20,
        running_cost=X**2 + 0.1 * U**2,
        terminal_cost=5 * X**2 + V**2,
        control_bounds=Box(-4, 4),
        constraints=(Constraint("slow", V, -0.8, 0.8, soft=soft),),
    )


@pytest.mark.many
@pytest.mark.parametrize(
    ("ocp", "solver"),
    [
        (regulator(Soft(50)), MultipleShooting(20)),
        (regulator(Soft(50)), MultipleShooting(20, backend="fatrop")),
        (regulator(Soft(50, 1), dt=0.1), LinearMPC()),
    ],
    ids=["ipopt", "fatrop", "osqp"],
)
def test_a_loop_that_starts_outside_follows_new_plans(ocp, solver):
    """Too fast at first, which a hard row would call infeasible."""
    loop = MPC(ocp=ocp, solver=solver, dt=0.1)
    rollout = loop.run(Plant(ocp=ocp), [2.0, -1.5], 3.0)
    assert all(source is InputSource.OPTIMAL for source in rollout.sources)
    assert abs(rollout.x[-1, 0]) < 0.2
    assert np.abs(rollout.x[8:, 1]).max() < 0.8 + 1e-3


def test_in_discrete_time_methods_agree():
    ocp = regulator(Soft(50, 1), dt=0.1)
    costs = [
        evaluate(solve(ocp, solver).or_raise()).cost
        for solver in (MultipleShooting(), LinearMPC(), LinearMPC(form="condensed"))
    ]
    assert costs[1:] == pytest.approx([costs[0]] * 2, rel=1e-5)


def test_discretised_the_price_is_one_a_step():
    steps = discretise(regulator(Soft(50, 2)), 0.1)
    soft = steps.constraints[0].soft
    assert soft is not None
    assert (soft.linear, soft.quadratic) == (pytest.approx([5.0]), pytest.approx([0.2]))


def test_a_guess_outside_is_given_its_slack():
    form = normal_form(transfer(Soft(10)))
    assert form is not None
    fast = np.array(form.slack([0, 1.5], [0.0], 0.0, []))
    assert fast == pytest.approx(0.3)
    guess = Guess(x=np.array([[0, 0], [0.5, 1.5], [1, 0]]), u=[0.0])
    assert solve(transfer(Soft(10)), MultipleShooting(20), guess=guess).status.is_success


def test_the_description_says_it():
    text = transfer(Soft(10, 2)).describe()
    assert "-3 <= velocity <= 1.2   (slow, path, soft at 10 e + 2 e^2)" in text


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: transfer(Soft()), "row 0 is soft at no price"),
        (lambda: transfer(Soft(-1.0)), "it must be 0 or more"),
        (lambda: transfer(Soft(np.inf)), "linear price"),
        (lambda: transfer(Soft([1, 2])), "has 2 entries, 1 are needed"),
        (lambda: transfer(1.0), "soft is a float, Soft is needed"),  # pyright: ignore
        (
            lambda: Constraint("begin", X, 0, 0, at="initial", soft=Soft(1)),
            "hold at='path' or at='terminal'",
        ),
        (lambda: Constraint("push", U, 0, 1, limits_input=True, soft=Soft(1)), "limits an input"),
    ],
)
def test_bad_input(make, said):
    with pytest.raises(ProblemError, match=said):
        make()
