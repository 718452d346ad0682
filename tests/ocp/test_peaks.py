"""The largest value along the way as a cost: closed forms, the referee, bad input."""

import pickle
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
    Model,
    Peak,
    Plant,
    ProblemError,
    Rate,
    Soft,
    Solution,
    Status,
    Unknown,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import (
    BetweenNodes,
    Collocation,
    IndirectShooting,
    LinearMPC,
    MultipleShooting,
    certify,
    diagnose,
)
from tests.ocp.mass import ARRIVAL, MASS, pushed
from tests.ocp.mass import FORCE as F
from tests.ocp.mass import POSITION as P
from tests.ocp.mass import VELOCITY as V


def mass(**changes: Any) -> OCP:
    effort = {"running_cost": 0.0, "peaks": (Peak("effort", ca.fabs(F)),)}
    return pushed(**(effort | changes))


DIRECT = [MultipleShooting(40), Collocation(10)]


@pytest.mark.parametrize("solver", DIRECT, ids=repr)
def test_the_weakest_force_that_arrives_pushes_and_brakes(solver):
    """Bang-bang of 4 x / T^2."""
    found = solve(mass(), solver).or_raise()
    assert found.peaks["effort"] == pytest.approx(4.0, rel=1e-6)
    assert evaluate(found).cost == pytest.approx(4.0, rel=1e-6)
    assert found.x.shape[1] == 2


FINE = [MultipleShooting(40), Collocation(40), BetweenNodes(MultipleShooting(40))]


@pytest.mark.parametrize("solver", FINE, ids=repr)
def test_the_lowest_top_speed(solver):
    """A trapezoid: v - v^2 / 8 = 1 with 8 N, if its corners were nodes."""
    ocp = mass(control_bounds=Box(-8, 8), peaks=(Peak("speed", V, 10.0),), running_cost=1e-6 * F**2)
    found = solve(ocp, solver).or_raise()
    assert found.peaks["speed"] == pytest.approx(4 - np.sqrt(8), rel=2e-3)
    assert evaluate(found).cost == pytest.approx(found.cost, rel=1e-2)


@pytest.mark.parametrize("solver", DIRECT, ids=repr)
def test_it_is_a_constant_that_nothing_exceeds(solver):
    top = ca.SX.sym("top")
    by_hand = mass(
        peaks=(),
        terminal_cost=2 * top,
        unknowns=(Unknown("top", top, 1.0),),
        constraints=(ARRIVAL, Constraint("effort", ca.vertcat(F, -F) - top, upper=0)),
    )
    hand, found = solve(by_hand, solver), solve(mass(peaks=(Peak("e", ca.fabs(F), 2.0),)), solver)
    assert found.cost == pytest.approx(hand.cost, rel=1e-7)
    np.testing.assert_allclose(found.x, hand.x, atol=1e-6)


def test_several_rows_and_several_peaks_beside_other_terms():
    rows = ca.vertcat(ca.fmax(F, -2 * F), V)
    ocp = mass(
        running_cost=1e-3 * F**2,
        peaks=(Peak("both", rows), Peak("speed", V, 5.0)),
        rates=(Rate(F, -60, 60),),
        last_input=[0.0],
        constraints=(ARRIVAL, Constraint("slow", V, upper=1.4, soft=Soft(1.0))),
    )
    guess = Guess(x=[[0, 0], [1, 0]], u=[[5.0], [-5.0]])
    found = solve(ocp, MultipleShooting(40), guess=guess).or_raise()
    force, speed = found.u[:, 0], found.x[:, 1]
    assert found.peaks["both"] == pytest.approx(max(force.max(), -2 * force.min()), rel=1e-5)
    assert found.peaks["speed"] == pytest.approx(speed.max(), rel=1e-5)
    assert evaluate(found).cost == pytest.approx(found.cost, rel=2e-3)


def test_in_discrete_time_a_control_has_no_value_at_the_end():
    steps = Model(name="steps", x=MASS.x, u=F, f=ca.vertcat(P + 0.1 * V, V + 0.1 * F), dt=0.1)
    found = solve(mass(model=steps, horizon=10), MultipleShooting()).or_raise()
    assert found.peaks["effort"] == pytest.approx(np.abs(found.u).max(), rel=1e-6)
    assert evaluate(found).cost == pytest.approx(found.cost, rel=1e-9)
    with pytest.raises(UnsupportedProblem, match="peak of effort"):
        LinearMPC().build(mass(model=steps, horizon=10))


def test_the_referee_takes_the_largest_value_between_the_nodes():
    swing = mass(constraints=(), peaks=(Peak("speed", V, 2.0),))
    found = Solution(
        problem=swing,
        solver="by hand",
        status=Status.SOLVED,
        t=np.array([0.0, 1.0]),
        x=np.zeros((2, 2)),
        x0=np.zeros(2),
        costate=np.zeros((2, 2)),
        u=np.array([[1.0], [-1.0]]),
        control_kind="linear",
        cost=0.0,
    )
    assert evaluate(found).cost == pytest.approx(2 * 0.25, rel=1e-6)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_change_nothing(unit):
    model = Model(name="m", x=MASS.x, u=F, f=ca.vertcat(V, F * unit))
    found = solve(mass(model=model), MultipleShooting(40)).or_raise()
    assert found.peaks["effort"] * unit == pytest.approx(4.0, rel=1e-6)


@pytest.mark.slow
def test_files_words_and_the_other_tools(tmp_path):
    ocp = mass()
    found = solve(ocp, MultipleShooting(10)).or_raise()
    copies = (pickle.loads(pickle.dumps(found)), Solution.load(found.save(tmp_path / "s"), ocp))
    for copy in copies:
        assert copy.peaks == found.peaks
        assert evaluate(copy).cost == evaluate(found).cost
    with pytest.raises(ProblemError, match="peaks differ"):
        Solution.load(tmp_path / "s.npz", mass(peaks=(Peak("effort", ca.fabs(F), 2.0),)))
    assert "+ max effort" in ocp.describe()
    assert "effort = fabs(force)" in ocp.describe()
    assert not diagnose(ocp).findings
    with pytest.raises(UnsupportedProblem, match=r"path constraint \('effort'\)"):
        IndirectShooting(5).build(ocp)


@pytest.mark.slow
def test_a_loop_keeps_the_peak_of_its_horizon_low():
    ocp = mass(
        constraints=(),
        running_cost=(P - 1) ** 2 + 0.01 * F**2,
        horizon=2.0,
        peaks=(Peak("effort", ca.fabs(F), 0.1),),
    )
    rollout = MPC(ocp=ocp, solver=MultipleShooting(20), dt=0.1).run(Plant(ocp=ocp), [0, 0], 5.0)
    assert abs(rollout.x[-1, 0] - 1) < 0.1


@pytest.mark.slow
def test_two_methods_agree():
    found = certify(solve(mass(), MultipleShooting(40)))
    assert len(found.estimates) == 2
    assert found.estimates[0].cost == pytest.approx(4.0, abs=1e-5)


def test_bad_input_is_refused():
    stranger = ca.SX.sym("stranger")
    for said, make in (
        ("weight", lambda: Peak("a", F, -1.0)),
        ("weight", lambda: Peak("a", F, 0.0)),
        ("weight", lambda: Peak("a", F, np.nan)),
        ("peak 'a'", lambda: Peak("a", "force")),  # pyright: ignore[reportArgumentType]
        ("peak 'a'.*stranger", lambda: mass(peaks=(Peak("a", stranger),))),
        ("called 'arrival'", lambda: mass(peaks=(Peak("arrival", F),))),
        ("an entry of peaks", lambda: mass(peaks=(F,))),
    ):
        with pytest.raises(ProblemError, match=said):
            make()
