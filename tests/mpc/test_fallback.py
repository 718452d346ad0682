"""Which backup law is in force, told by what the problem is; and that it answers and replays."""

from dataclasses import replace
from functools import reduce
from operator import add
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from benchmarks.mpc.faults import SUBJECTS, campaign
from models import cart_pole_upright
from models.textbook import double_integrator_minimum_time, van_der_pol
from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    ControlRefused,
    FlightRecorder,
    InputSource,
    Model,
    Parameter,
    Plant,
    PlantInput,
    ProblemError,
    Signal,
    Solution,
    Status,
    discretise,
    instantaneous,
    replay_all,
    saturated_lqr,
)
from ocp.mpc.backup_selection import Backup, is_redundant, select_backup
from solvers import MultipleShooting
from tests.mpc.problems import LIMIT, cart, scripted

DT = 0.1
REGULATOR, KINEMATICS = "saturated regulator", "instantaneous control"


def law_of(ocp: OCP, dt: float = DT) -> Backup:
    return select_backup("default", ocp, dt, PlantInput())


def fails(solution: Solution) -> Solution:
    return solution.with_(status=Status.FAILED, message="as the script says")


def always_failing(ocp: OCP, **options) -> MPC:
    script = {round(k * DT, 2): fails for k in range(100)}
    return MPC(ocp=ocp, solver=scripted(script), dt=DT, compiled=False, **options)


# -- what the problem is -------------------------------------------------------------------


def body() -> OCP:
    """A turning body: the norm of its attitude is kept, but no task leaves it free."""
    x, u = ca.SX.sym("x", 3), ca.SX.sym("u")
    return OCP(
        name="turntable",
        model=Model(name="turntable", x=x, u=u, f=ca.vertcat(-x[1] * x[2], x[0] * x[2], u)),
        x0=[1.0, 0.0, 0.0],
        horizon=1.0,
        running_cost=ca.sumsqr(x) + u**2,
        invariants=(Constraint("norm", ca.sumsqr(x[:2]), 1.0, 1.0),),
    )


def test_each_problem_gets_the_law_that_fits_it():
    arm = arm_scenario("arm-001")
    assert law_of(cart()).name == REGULATOR
    assert law_of(discretise(cart(), DT)).name == REGULATOR
    assert law_of(arm.ocp("sum")).name == KINEMATICS
    for other in (arm.ocp("sum", form="velocity"), cart_pole_upright(), van_der_pol(), body()):
        assert law_of(other).name == "hold", other.name


def test_the_form_of_the_arm_counts_not_its_name():
    arm = arm_scenario("arm-001")
    assert is_redundant(replace(arm.ocp("sum"), name="anything"))
    assert not is_redundant(arm.ocp("sum", form="velocity"))
    assert not is_redundant(replace(arm.ocp("sum"), invariants=()))
    assert not is_redundant(body())


def test_a_law_that_cannot_be_built_gives_way_to_hold_and_says_why():
    bang = law_of(double_integrator_minimum_time())
    assert bang.name == "hold"
    assert "R is not positive definite" in bang.why
    raw = law_of(arm_scenario("arm-001").ocp("sum", cost="raw"))
    assert raw.name == "hold"
    assert "H_uu is singular" in raw.why
    x, u, mass = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("mass")
    model = Model(name="cart", x=x, u=u, f=ca.vertcat(x[1], u / mass))
    heavy = replace(cart(), model=model, running_cost=ca.sumsqr(x) + u**2, terminal_cost=0.0,
                    constraints=(), parameters=(Parameter("mass", mass, 1.0),))  # fmt: skip
    assert "B depends on mass" in law_of(heavy).why


def test_what_ends_or_bounds_the_problem_plays_no_part():
    """A horizon that is no multiple of dt, a curved constraint and end, references that move."""
    plain = cart()
    x, u, aim = plain.model.x, plain.model.u, ca.SX.sym("aim")
    moved = replace(
        plain,
        horizon=0.73,
        running_cost=10.0 * (x[0] - aim) ** 2 + x[1] ** 2 + 0.1 * u**2,
        terminal_cost=ca.sin(x[0]) ** 2,
        constraints=(Constraint("disc", ca.sumsqr(x), upper=9.0),),
        parameters=(Signal("aim", aim, np.linspace(0.0, 1.0, 8), "linear"),),
    )
    law, same = saturated_lqr(moved, dt=DT), saturated_lqr(plain, dt=DT)
    here, there = np.array([0.1, 0.2]), np.array([0.6, 0.2])
    np.testing.assert_allclose(law(here, 0.0), same(here, 0.0), rtol=1e-12)
    np.testing.assert_allclose(law(there, 0.0, np.array([0.5])), same(here, 0.0), rtol=1e-10)


# -- which law is in force ------------------------------------------------------------------


def test_the_law_in_force_is_seen():
    mpc = always_failing(cart())
    assert f"backup_law=Backup({REGULATOR})" in repr(mpc)
    x = np.array([0.5, 0.0])
    decision = mpc.step(x, 0.0)
    assert decision.source is InputSource.BACKUP
    assert decision.message.endswith(f"backup: {REGULATOR}")
    np.testing.assert_allclose(decision.input, saturated_lqr(cart(), dt=DT)(x, 0.0))
    own = always_failing(cart(), backup=lambda x, t: [0.5])
    assert own.backup_law.name == "the user's law"
    assert own.step([0.5, 0.0], 0.0).input == [0.5]


def test_none_refuses_even_where_an_input_could_be_held():
    mpc = replace(always_failing(cart(), backup=None))
    mpc.state = mpc.state.after(np.array([1.0]), None, solver_ran=True)
    with pytest.raises(ControlRefused, match="there is no backup law"):
        mpc.step([0.5, 0.0], 0.0)
    holding = replace(mpc, backup="hold")
    with pytest.raises(ControlRefused, match="there is no input to hold"):
        holding.step([0.5, 0.0], 0.0)


@pytest.mark.parametrize("choice", ["lqr", 3.0, [0.0]])
def test_a_choice_that_is_none(choice):
    with pytest.raises(ProblemError, match="neither a law"):
        MPC(ocp=cart(), solver=MultipleShooting(10), dt=DT, backup=choice)


def test_without_a_state_the_suggested_law_goes_by_the_model():
    """What acted since the last measurement is known, and where that leads."""
    blind, seeing = always_failing(cart()), always_failing(cart())
    given = blind.step([0.5, 0.0], 0.0).input[0]
    seeing.step([0.5, 0.0], 0.0)
    decision = blind.step([np.nan, 0.0], DT)
    expected = [0.5 + DT**2 / 2 * given, DT * given]
    np.testing.assert_allclose(decision.input, seeing.step(expected, DT).input)
    assert "not finite" in decision.message


def test_without_any_state_there_is_nothing_to_go_by():
    with pytest.raises(ControlRefused, match="no input to hold"):
        always_failing(cart()).step([np.nan, 0.0], 0.0)


# -- what it does ------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_suggested_regulator_brings_the_cart_home():
    rollout = always_failing(cart()).run(Plant(ocp=cart()), [0.5, 0.0], 6.0)
    assert set(rollout.sources) == {InputSource.BACKUP}
    assert np.abs(rollout.x[-1]).max() < 1e-2
    assert np.abs(rollout.inputs).max() <= LIMIT


def test_the_suggested_kinematics_send_what_the_plant_receives():
    ocp = arm_scenario("arm-001").ocp("sum")
    x = ocp.start()
    for applied in (PlantInput(), PlantInput("rate", Box(-9.0, 9.0))):
        decision = always_failing(ocp, applied=applied).step(x, 0.0)
        expected = instantaneous(ocp, sent=applied.what)(x, 0.0)
        np.testing.assert_array_equal(decision.input, expected)


@pytest.mark.slow
def test_steps_of_a_suggested_law_replay_to_the_last_bit(tmp_path: Path):
    plain = cart()
    x, aim = plain.model.x, ca.SX.sym("aim")
    ocp = replace(
        plain,
        running_cost=plain.running_cost + (x[0] - aim) ** 2,
        parameters=(Parameter("aim", aim, 0.0),),
    )

    def known(t: float) -> dict[str, float]:
        if 0.4 < t < 0.7:
            raise ValueError("nobody knows")
        return {"aim": np.sin(3.0 * t)}

    script = {round(k * DT, 2): fails for k in range(2, 100)}
    mpc = MPC(ocp=ocp, solver=scripted(script), dt=DT, parameters=known, compiled=False)
    plant = Plant(ocp=cart(mass=1.2), measurement_noise=0.01)
    with FlightRecorder(mpc, tmp_path / "flight") as recorder:
        rollout = mpc.run(plant, [1.0, 0.0], 3.0, watch=recorder.watch).or_raise()
    assert rollout.counts[InputSource.BACKUP] > 10
    steps = range(len(rollout.sources))
    assert all(step.is_exact for step in replay_all(mpc, tmp_path / "flight", steps))


@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize(("subject", "steps"), [("cart", 400), ("arm", 200)])
def test_no_fault_gets_through_with_the_suggested_laws(subject, steps, monkeypatch):
    usual = SUBJECTS[subject]

    def suggested(faults):
        made = usual(faults)
        return replace(made, mpc=replace(made.mpc, backup="default"))

    monkeypatch.setitem(SUBJECTS, subject, suggested)
    report = reduce(add, campaign(subject, steps, seed=1))
    assert report.is_clean, report
    assert any(source is InputSource.BACKUP for _, source in report.sources), "it was needed"
