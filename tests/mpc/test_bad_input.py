"""What other people's code gives the driver: parameters, backup laws, plants, files."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from models import sinusoid, stable_plant, thesis_regulator, thesis_tracking
from ocp import (
    MPC,
    Constraint,
    ControlRefused,
    Decision,
    FeedbackLaw,
    FlightRecorder,
    FreeTime,
    InputSource,
    Plant,
    PlantInput,
    ProblemError,
    Rollout,
    Signal,
    Solution,
    UnsupportedProblem,
    closed_loop,
    records,
    replay,
)
from solvers import LinearMPC, MultipleShooting
from tests.mpc.problems import cart

DT, STEPS = 0.05, 10
START = [1.0, 0.0]


# -- parameters ----------------------------------------------------------------------------


def tracking(known: float, **options) -> MPC:
    """A driver whose reference is known up to an instant [s]."""
    samples = sinusoid(DT * np.arange(round(known / DT) + 1))

    def ahead(t: float) -> dict[str, np.ndarray]:
        first = round(t / DT)
        return {"reference": samples[first : first + STEPS + 1]}

    return MPC(
        ocp=thesis_tracking(STEPS, dt=DT), solver=LinearMPC(), dt=DT, parameters=ahead, **options
    )


def mass() -> Plant:
    return Plant(ocp=thesis_tracking(1, dt=DT))


def test_a_reference_that_ends_leaves_the_last_plan_and_then_the_backup_law(tmp_path: Path) -> None:
    mpc = tracking(1.0, backup=lambda x, t: [-x[1]])
    with FlightRecorder(mpc, tmp_path / "flight") as recorder:
        rollout = mpc.run(mass(), np.zeros(2), 1.5, watch=recorder.watch)
    # The last whole preview starts at 0.5 s; its plan lasts for 9 more steps.
    assert set(rollout.sources[:11]) == {InputSource.OPTIMAL}
    assert set(rollout.sources[11:20]) == {InputSource.SHIFTED}
    assert set(rollout.sources[20:]) == {InputSource.BACKUP}
    assert "no parameters from t = 0.55 s on" in rollout.messages[11]
    assert "'reference' has 10 samples" in rollout.messages[11]
    assert not rollout.decisions[11].parameters_known
    assert not rollout.decisions[11].parameters
    np.testing.assert_allclose(rollout.inputs[11:20], plan_of(rollout.decisions[10]).u[1:])
    assert len(list(records(tmp_path / "flight"))) == 30
    assert all(replay(mpc, tmp_path / "flight", k).is_exact for k in (5, 11, 19, 25))


def plan_of(decision: Decision) -> Solution:
    assert decision.plan is not None
    return decision.plan


def test_an_earlier_plan_is_judged_by_the_parameters_it_was_made_with() -> None:
    """A wall at 2 m, as somebody says; as declared it is at 0, where no plan would hold."""
    told, ocp, wall = {"on": True}, cart(), ca.SX.sym("wall")
    walled = replace(
        ocp,
        constraints=(Constraint("wall", ocp.model.x[0] - wall, upper=0.0),),
        parameters=(Signal("wall", wall, np.zeros((2, 1))),),
    )

    def by_radio(t: float) -> dict[str, np.ndarray]:
        if not told["on"]:
            raise LookupError("the radio is off")
        return {"wall": np.full((2, 1), 2.0)}

    mpc = MPC(ocp=walled, solver=MultipleShooting(10), dt=0.1, parameters=by_radio)
    first = mpc.step(START, 0.0)
    assert first.source is InputSource.OPTIMAL
    told["on"] = False
    second = mpc.step(plan_of(first).x[1], 0.1)
    assert second.source is InputSource.SHIFTED
    assert "the radio is off" in second.message
    told["on"] = True
    assert mpc.step(plan_of(first).x[2], 0.2).source is InputSource.OPTIMAL


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"refrence": np.zeros((11, 2))}, "unknown parameters: refrence"),
        ({"reference": np.zeros((11, 3))}, r"shape \(11, 3\)"),
        ({"reference": np.full((11, 2), np.nan)}, "not finite"),
    ],
)
def test_parameters_that_never_fit_are_an_error_at_the_first_step(given, message) -> None:
    mpc = replace(tracking(1.0), parameters=lambda t: given, backup=lambda x, t: [0.0])
    with pytest.raises(ProblemError, match=message):
        mpc.step(np.zeros(2), 0.0)


# -- laws ----------------------------------------------------------------------------------


def broken(x: np.ndarray, t: float) -> list[float]:
    raise ZeroDivisionError("as the test says")


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (broken, "ZeroDivisionError inside the backup law"),
        (lambda x, t: [np.nan], "the backup law returned"),
        (lambda x, t: None, "the backup law returned None"),
        (lambda x, t: "left", "the backup law returned left"),
        (lambda x, t: [1j], "the backup law returned"),
        (lambda x, t: [[1.0], [2.0, 3.0]], "the backup law returned"),
        (lambda x, t: [1.0, 2.0], "the backup law returned 2 numbers, not 1"),
        (lambda x, t: [], "the backup law returned 0 numbers, not 1"),
    ],
)
def test_nonsense_of_a_backup_law_is_named_and_refused(law, message) -> None:
    mpc = replace(tracking(1.0), backup=law)
    with pytest.raises(ControlRefused, match=message):
        mpc.step([np.nan, 0.0], 0.0)


def test_without_plan_and_measurement_the_backup_law_is_told_so() -> None:
    seen: list[np.ndarray] = []
    mpc = replace(tracking(1.0), backup=lambda x, t: (seen.append(x), [0.5])[1])
    decision = mpc.step([np.nan, 0.0], 0.0)
    assert decision.source is InputSource.BACKUP
    assert np.isnan(seen[0][0]), "no state is made up"


@pytest.mark.parametrize("law", [broken, lambda x, t: [np.inf], lambda x, t: None])
def test_nonsense_of_a_law_ends_the_loop_by_name(law) -> None:
    rollout = closed_loop(FeedbackLaw(law=law), Plant(ocp=cart()), START, 1.0, dt=0.1)
    assert rollout.ended.startswith("t = 0 s: ")
    assert "the law" in rollout.ended
    assert len(rollout.inputs) == 0


def test_a_plan_fed_forward_is_followed_to_its_end_and_held() -> None:
    plan = LinearMPC().build(thesis_tracking(STEPS, dt=DT)).run()
    rollout = closed_loop(FeedbackLaw.following(plan), mass(), plan.x0, 2 * STEPS * DT, dt=DT)
    np.testing.assert_array_equal(rollout.inputs[:STEPS], plan.u)
    np.testing.assert_array_equal(rollout.inputs[STEPS:], np.tile(plan.u[-1], (STEPS, 1)))
    np.testing.assert_allclose(rollout.x[: STEPS + 1], plan.x, atol=1e-9)


# -- problems and plants -------------------------------------------------------------------


def test_a_free_start_or_final_time_is_refused() -> None:
    ocp = cart()
    manifold = Constraint("start", ocp.model.x[0], 0.0, 0.0, at="initial")
    with pytest.raises(UnsupportedProblem, match="start is free, here it is measured"):
        MPC(ocp=replace(ocp, constraints=(manifold,)), solver=MultipleShooting(10), dt=0.1)
    free = replace(ocp, horizon=FreeTime(guess=1.0))
    with pytest.raises(UnsupportedProblem, match="final time is free"):
        MPC(ocp=free, solver=MultipleShooting(10), dt=0.1)


@pytest.mark.parametrize("name", ["ocp", "solver", "applied"])
def test_what_is_of_a_wrong_kind_is_named(name) -> None:
    options: dict[str, Any] = {"ocp": cart(), "solver": MultipleShooting(10), "dt": 0.1}
    options[name] = "control"
    with pytest.raises(ProblemError, match=f"MPC: {name} is a str"):
        MPC(**options)


def test_a_plant_of_another_size_is_refused_before_the_start() -> None:
    rate = MPC(ocp=cart(), solver=MultipleShooting(10), dt=0.1, applied=PlantInput("rate"))
    with pytest.raises(ProblemError, match=r"2 inputs, but the plant 'cart' has 1"):
        rate.run(Plant(ocp=cart()), START, 0.5)
    plant = Plant(ocp=thesis_regulator(stable_plant(), 5))
    with pytest.raises(ProblemError, match=r"2 states, but the plant .* has 3"):
        tracking(1.0).run(plant, np.zeros(3), 0.5)


@pytest.mark.parametrize(
    ("plant", "message"),
    [
        ({"disturbance": 0.3}, "disturbance is a float, a function is needed"),
        ({"parameters": {"reference": [1.0]}}, "plant: parameters is a .*, a function is needed"),
        ({"saturation": (-1.0, 1.0)}, "plant: saturation is a tuple, Box is needed"),
        ({"disturbance": lambda t: [1.0, 2.0]}, "plant: disturbance has 2 entries"),
        ({"disturbance": lambda t: [np.nan]}, "a finite number is needed"),
        ({"parameters": lambda t: {}}, "no value of reference at t = 0 s"),
        ({"parameters": lambda t: {"reference": [1.0, 2.0, 3.0]}}, "'reference' has 3 entries"),
    ],
)
def test_a_function_of_the_plant_that_does_not_fit(plant, message) -> None:
    law = FeedbackLaw(law=lambda x, t: [0.0])
    with pytest.raises(ProblemError, match=message):
        closed_loop(law, replace(mass(), **plant), np.zeros(2), 1.0, dt=DT)


def test_a_problem_is_no_plant() -> None:
    with pytest.raises(ProblemError, match="closed loop: plant is an OCP, Plant is needed"):
        closed_loop(FeedbackLaw(law=lambda x, t: [0.0]), cart(), START, 1.0, dt=DT)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"dt": 0.0}, r"dt \[s\] = 0.0, it must be positive"),
        ({"dt": np.nan}, r"dt \[s\] = nan"),
        ({"dt": 0.1, "initial_input": [1.0, 2.0]}, "initial_input has 2 entries"),
        ({"dt": 0.1, "initial_input": np.nan}, "a finite number is needed"),
    ],
)
def test_a_loop_that_is_none(options, message) -> None:
    with pytest.raises(ProblemError, match=message):
        closed_loop(FeedbackLaw(law=lambda x, t: [0.0]), Plant(ocp=cart()), START, 1.0, **options)


def test_a_rollout_that_was_cut_off_or_changed(tmp_path: Path) -> None:
    law = FeedbackLaw(law=lambda x, t: [0.0])
    file = closed_loop(law, mass(), np.zeros(2), 0.5, dt=DT).save(tmp_path / "loop")
    whole = file.read_bytes()
    (tmp_path / "short.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ProblemError, match="no saved rollout"):
        Rollout.load(tmp_path / "short.npz", mass().ocp)
    with np.load(file) as data:
        content: dict[str, Any] = dict(data)
    odd: dict[str, Any] = content | {"outcomes": np.full(10, 7)}
    np.savez(tmp_path / "odd.npz", **odd)
    with pytest.raises(ProblemError, match="a source is '7', which is no rung"):
        Rollout.load(tmp_path / "odd.npz", mass().ocp)
    del content["x"]
    np.savez(tmp_path / "less.npz", **content)
    with pytest.raises(ProblemError, match="x missing"):
        Rollout.load(tmp_path / "less.npz", mass().ocp)
