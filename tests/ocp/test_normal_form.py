"""Unknown constants, coupled ends and integrals: each with its closed form, by several methods."""

import copy
import gc
import pickle
import weakref
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    FreeTime,
    Guess,
    Model,
    Parameter,
    ProblemError,
    Solution,
    Unknown,
    UnsupportedProblem,
    costates_along,
    evaluate,
    solve,
)
from ocp.internal import normal_form, sizes_of
from solvers import (
    Collocation,
    IndirectShooting,
    MultipleShooting,
    certify,
    diagnose,
    multistart,
    polish,
    refine_mesh,
)

X, U, K, T = (ca.SX.sym(name) for name in ("x", "u", "k", "t"))


def geared(**changes: Any) -> OCP:
    """Through a gear of ratio k from 0 to 1 in 1 s: J = 1/(2 k^2) + k^2/2, least at k = 1."""
    given: dict[str, Any] = {
        "name": "gear",
        "model": Model(name="axis", x=X, u=U, f=K * U),
        "x0": [0.0],
        "horizon": 1.0,
        "running_cost": U**2 / 2,
        "terminal_cost": K**2 / 2,
        "constraints": (Constraint("arrival", X, 1, 1, at="terminal"),),
        "unknowns": (Unknown("ratio", K, guess=0.5, lower=0.1, upper=5.0),),
    }
    return OCP(**(given | changes))


def with_bound(upper: float) -> OCP:
    return geared(unknowns=(Unknown("ratio", K, guess=0.5, lower=0.1, upper=upper),))


def budgeted(upper: float = 1.0, **bounds: Any) -> OCP:
    """As far as an integral of u^2 takes it: J = -sqrt(upper / 3), multiplier 1/(2 sqrt(3))."""
    budget = Constraint("budget", U**2, upper=upper, at="integral", **bounds)
    model = Model(name="integrator", x=X, u=U, f=U)
    return OCP(
        name="budget", model=model, x0=[0.0], horizon=1.0, running_cost=-X, constraints=(budget,)
    )


def periodic() -> OCP:
    """Follow a sine with a lag, as it does for ever: J = 2 pi / 3, x(0) = 0."""
    model = Model(name="lag", x=X, u=U, f=U - X, t=T)
    return OCP(
        name="period",
        model=model,
        x0=[1.0],
        horizon=2 * np.pi,
        running_cost=(X - ca.sin(T)) ** 2 + U**2,
        constraints=(Constraint("lap", X - model.start, 0, 0, at="terminal"),),
        free_start=("x",),
    )


DIRECT = [MultipleShooting(60), MultipleShooting(60, backend="fatrop"), Collocation(12)]


@pytest.mark.parametrize("solver", DIRECT, ids=repr)
class TestDirect:
    def test_an_unknown_constant_is_chosen(self, solver):
        found = solve(geared(), solver).or_raise()
        verdict = evaluate(found)
        assert found.unknowns["ratio"] == pytest.approx([1.0], abs=1e-6)
        assert found.sensitivity["ratio"] == pytest.approx([0.0], abs=1e-6)
        assert verdict.cost == pytest.approx(1.0, abs=1e-9)
        assert verdict.stationarity == pytest.approx(0.0, abs=1e-6)
        assert (found.x.shape[1], found.costate.shape[1], found.u.shape[1]) == (1, 1, 1)

    def test_a_bound_of_it_has_a_price(self, solver):
        found = solve(with_bound(0.8), solver).or_raise()
        assert found.unknowns["ratio"] == pytest.approx([0.8], abs=1e-6)
        assert found.sensitivity["ratio"] == pytest.approx([0.8 - 0.8**-3], abs=1e-4)

    def test_an_integral_is_bounded_and_has_a_price(self, solver):
        found = solve(budgeted(), solver).or_raise()
        assert evaluate(found).cost == pytest.approx(-np.sqrt(1 / 3), rel=1e-4)
        assert found.multipliers["budget"] == pytest.approx([0.5 / np.sqrt(3)], rel=1e-3)

    def test_both_ends_are_coupled(self, solver):
        found = solve(periodic(), solver).or_raise()
        assert evaluate(found).cost == pytest.approx(2 * np.pi / 3, rel=1e-3)
        assert found.x[-1] == pytest.approx(found.x[0], abs=1e-6)
        # In a period the costate is periodic too.
        assert found.costate[-1] == pytest.approx(found.costate[0], abs=1e-5)


def test_the_multiplier_is_the_slope_of_the_cost_in_the_bound():
    step = 1e-4
    low, high = (solve(budgeted(1 + d), Collocation(5)).cost for d in (-step, step))
    price = solve(budgeted(), Collocation(5)).multipliers["budget"][0]
    assert (high - low) / (2 * step) == pytest.approx(-price, rel=1e-5)


def test_indirect_methods_solve_the_same_problems():
    gear = solve(geared(), IndirectShooting(10), guess=solve(geared(), Collocation(3))).or_raise()
    assert gear.unknowns["ratio"] == pytest.approx([1.0], abs=1e-8)
    equal = solve(
        budgeted(lower=1.0), IndirectShooting(10), guess=solve(budgeted(), Collocation(3))
    )
    assert evaluate(equal.or_raise()).cost == pytest.approx(-np.sqrt(1 / 3), abs=1e-9)
    lap = solve(periodic(), IndirectShooting(10)).or_raise()
    verdict = evaluate(lap)
    assert verdict.cost == pytest.approx(2 * np.pi / 3, abs=1e-8)
    assert verdict.stationarity == pytest.approx(0.0, abs=1e-6)
    # Between the nodes the control is that of the normal form's minimum principle.
    assert equal.control(0.25)[0] == pytest.approx((1 - 0.25) * np.sqrt(3), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("ocp", [geared(), budgeted(), periodic()], ids=lambda ocp: ocp.name)
def test_they_are_certified(ocp):
    certificate = certify(solve(ocp, MultipleShooting(20)))
    assert certificate.holds
    assert certificate.solution.problem is ocp
    values = {"gear": 1.0, "budget": -np.sqrt(1 / 3), "period": 2 * np.pi / 3}
    assert certificate.cost == pytest.approx(values[ocp.name], abs=1e-8)


@pytest.mark.slow
def test_what_takes_a_solution_takes_these():
    ocp = geared()
    rough = solve(ocp, MultipleShooting(10))
    exact = polish(rough).or_raise()
    assert exact.unknowns["ratio"] == pytest.approx([1.0], abs=1e-9)
    assert exact.problem is ocp
    finer = refine_mesh(rough).solution.or_raise()
    assert finer.unknowns["ratio"] == pytest.approx([1.0], abs=1e-8)
    assert not diagnose(rough).findings
    (best,) = multistart(ocp, Collocation(4), 2, 0)
    assert best.solution.unknowns["ratio"] == pytest.approx([1.0], abs=1e-6)
    assert costates_along(rough).costate == pytest.approx(rough.costate, abs=1e-5)
    rough.plot()


def test_a_solution_without_its_normal_form_is_no_start_of_a_polish():
    alone = replace(solve(geared(), MultipleShooting(10)), normal=None)
    with pytest.raises(ProblemError, match="lacks what its normal form adds"):
        polish(alone)


def test_files_and_copies_keep_everything(tmp_path):
    ocp = geared()
    found = solve(ocp, MultipleShooting(10))
    read = Solution.load(found.save(tmp_path / "gear"), ocp)
    for again in (read, pickle.loads(pickle.dumps(found)), copy.deepcopy(found)):
        assert again.unknowns["ratio"] == found.unknowns["ratio"]
        assert again.sensitivity["ratio"] == found.sensitivity["ratio"]
        assert evaluate(again).cost == pytest.approx(evaluate(found).cost, abs=1e-15)
    with pytest.raises(ProblemError, match="unknown constants"):
        Solution.load(tmp_path / "gear.npz", with_bound(0.8))


def test_a_guess_of_the_constant_is_taken():
    seen = normal_form(geared())
    assert seen is not None
    program = MultipleShooting(4, max_iterations=1).build(geared())
    found = program.run(guess=Guess(x=[0.5], unknowns={"ratio": 3.0}))
    default = program.run(guess=Guess(x=[0.5]))
    assert found.unknowns["ratio"] != default.unknowns["ratio"]


def test_a_problem_in_simple_terms_is_its_own_normal_form():
    plain = geared(unknowns=(), model=Model(name="axis", x=X, u=U, f=U), terminal_cost=X**2 / 2)
    assert normal_form(plain) is None
    ocp = geared()
    assert normal_form(ocp) is normal_form(ocp)


@pytest.mark.parametrize("make", [geared, lambda: geared(x0=[1e6])])
def test_a_problem_is_forgotten_with_all_that_was_made_of_it(make):
    ocp = make()
    solve(ocp, MultipleShooting(4))
    left = weakref.ref(ocp)
    del ocp
    gc.collect()
    assert left() is None


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(unit=st.integers(-6, 6))
def test_units_do_not_matter(unit):
    """x in another unit: the same constant, and prices in that unit."""
    size = 10.0**unit
    ocp = geared(
        model=Model(name="axis", x=X, u=U, f=K * U * size),
        constraints=(Constraint("arrival", X, size, size, at="terminal"),),
    )
    found = solve(ocp, Collocation(4)).or_raise()
    assert found.unknowns["ratio"] == pytest.approx([1.0], abs=1e-6)
    assert sizes_of(ocp).x[0] == pytest.approx(size, rel=10)


def test_several_of_each_together():
    """Two constants, one of them a vector; an integral of two rows; a lap: all in one problem."""
    k = ca.SX.sym("k", 2)
    model = Model(name="lag", x=X, u=U, f=U - X + k[0], t=T)
    ocp = OCP(
        name="together",
        model=model,
        x0=[0.0],
        horizon=2 * np.pi,
        running_cost=(X - k[1] * ca.sin(T)) ** 2 + U**2,
        terminal_cost=(k[1] - 2) ** 2 + k[0] ** 2,
        constraints=(
            Constraint("lap", X - model.start, 0, 0, at="terminal"),
            Constraint("both", ca.vertcat(U, X), [-1, 0.5], [1, 3], at="integral"),
        ),
        unknowns=(Unknown("pair", k, guess=[0.1, 1.0]),),
        free_start=("x",),
    )
    direct, indirect = solve(ocp, Collocation(15)).or_raise(), solve(ocp, MultipleShooting(200))
    assert evaluate(direct).cost == pytest.approx(evaluate(indirect.or_raise()).cost, rel=1e-4)
    assert evaluate(direct).violation < 1e-6
    assert direct.unknowns["pair"] == pytest.approx(indirect.unknowns["pair"], abs=1e-2)
    assert direct.multipliers["both"].shape == (2,)


def test_the_referee_judges_by_itself():
    """A solution whose constant or integral is another one is not believed."""
    found = solve(geared(), MultipleShooting(10))
    moved = replace(found, unknowns={"ratio": np.array([1.1])})
    assert evaluate(moved).worst == "terminal constraint 'arrival'"
    assert evaluate(moved).violation == pytest.approx(0.1, abs=1e-6)
    spent = solve(budgeted(), MultipleShooting(40))
    twice = replace(spent, u=2 * spent.u)
    assert evaluate(twice).worst == "integral constraint 'budget'"
    assert evaluate(twice).violation == pytest.approx(3.0, abs=1e-6)


def test_the_description_says_it():
    assert "ratio (k): unknown constant, 0.1 <= k <= 5, guess (0.5)" in geared().describe()
    assert "sq(u) <= 1   (budget, integral)" in budgeted().describe()


P = ca.SX.sym("p")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: geared(unknowns=(Unknown("ratio", K, 1.0), Unknown("other", P, 1.0))), "appears"),
        (lambda: Unknown("ratio", K, 9.0, 0.0, 1.0), "guess .* is outside its bounds"),
        (lambda: Unknown("ratio", K, [1.0, 2.0]), "unknown constant 'ratio'"),
        (lambda: Unknown("ratio", K, np.nan), "unknown constant 'ratio'"),
        (lambda: Unknown("ratio", K, 1.0, 2.0, 0.0), "no number lies between"),
        (lambda: Unknown("ratio", K * 2, 1.0), "is an expression"),
        (lambda: geared(unknowns=(Parameter("ratio", K, 1.0),)), "an entry of unknowns"),
        (
            lambda: geared(parameters=(Parameter("ratio", P, 1.0),)),
            "two parameters are called 'ratio'",
        ),
        (lambda: geared(unknowns=()), "unknown at this place"),
        (
            lambda: OCP(
                name="sum",
                model=Model(name="steps", x=X, u=U, f=X + U, dt=1.0),
                x0=[0],
                horizon=3,
                constraints=(Constraint("total", U, upper=1, at="integral"),),
            ),
            "carry the sum as a state",
        ),
        (
            lambda: solve(geared(), MultipleShooting(4), guess=Guess(unknowns={"gain": 1.0})),
            "'gain' is no unknown constant; declared are: ratio",
        ),
        (
            lambda: MultipleShooting(4).build(geared()).run(parameters={"ratio": 1.0}),
            "'ratio' is an unknown constant",
        ),
    ],
)
def test_bad_input(make, said):
    with pytest.raises(ProblemError, match=said):
        make()


@pytest.mark.parametrize(
    ("ocp", "said"),
    [
        (geared(), "'ratio' is an unknown constant"),
        (budgeted(), "the integral constraint 'budget' would begin anew"),
    ],
)
def test_a_loop_refuses_what_it_cannot_mean(ocp, said):
    with pytest.raises(UnsupportedProblem, match=said):
        MPC(ocp=ocp, solver=MultipleShooting(10), dt=0.1)


def test_state_bounds_and_a_free_time_go_along():
    """Time-optimal with a gear: the faster the larger k, which has a price."""
    ocp = geared(
        horizon=FreeTime(2.0),
        running_cost=1.0,
        terminal_cost=K**2 / 2,
        control_bounds=Box(-1.0, 1.0),
        state_bounds=Box(-0.5, 1.5),
    )
    found = solve(ocp, MultipleShooting(20)).or_raise()  # T = 1/k, J = 1/k + k^2/2: k = 1
    assert found.unknowns["ratio"] == pytest.approx([1.0], abs=1e-5)
    assert evaluate(found).cost == pytest.approx(1.5, abs=1e-6)
