"""Loops: every kind of controller, real plants, delay, what is kept, and the flight recorder."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from models import PlanarArm, line, redundancy_ocp
from ocp import (
    MPC,
    Box,
    ControlRefused,
    FeedbackLaw,
    FlightRecorder,
    InputSource,
    Plant,
    PlantInput,
    ProblemError,
    Rollout,
    Solution,
    SolverError,
    Status,
    closed_loop,
    discretise,
    records,
    replay,
    replay_all,
    solve,
)
from solvers import (
    Collocation,
    Greedy,
    IndirectShooting,
    LinearMPC,
    MultipleShooting,
    Riccati,
    Schuetz,
    StagewiseNewton,
)
from tests.mpc.problems import cart, scripted

DT = 0.1
START = [1.0, 0.0]


def driver(**options) -> MPC:
    return MPC(ocp=cart(), solver=MultipleShooting(10), dt=DT, **options)


# -- every solver, every controller --------------------------------------------------------


@pytest.mark.parametrize(
    "solver",
    [
        MultipleShooting(20),
        StagewiseNewton(20),
        Collocation(8, 3),
        Schuetz.sound(intervals=20),
        IndirectShooting(),
        Greedy(intervals=20),
    ],
    ids=lambda solver: type(solver).__name__,
)
def test_continuous_solvers_run_in_the_loop(solver) -> None:
    ocp = unconstrained()
    rollout = MPC(ocp=ocp, solver=solver, dt=0.05).run(Plant(ocp=ocp), START, 1.0).or_raise()
    planned = [source.is_planned for source in rollout.sources]
    assert all(planned)
    if not isinstance(solver, Greedy):
        best = MPC(ocp=ocp, solver=MultipleShooting(20), dt=0.05)
        assert rollout.cost == pytest.approx(best.run(Plant(ocp=ocp), START, 1.0).cost, rel=1e-2)


@pytest.mark.parametrize(
    "solver",
    [LinearMPC(), LinearMPC(form="condensed"), Riccati(), MultipleShooting(), StagewiseNewton()],
    ids=repr,
)
def test_linear_solvers_run_in_the_loop(solver) -> None:
    ocp = discretise(unconstrained(), dt=0.05)
    rollout = MPC(ocp=ocp, solver=solver, dt=0.05).run(Plant(ocp=ocp), START, 1.0).or_raise()
    assert set(rollout.sources) == {InputSource.OPTIMAL}
    other = MPC(ocp=ocp, solver=LinearMPC(), dt=0.05).run(Plant(ocp=ocp), START, 1.0)
    np.testing.assert_allclose(rollout.inputs, other.inputs, atol=1e-6)


def unconstrained():
    return replace(cart(), constraints=(), control_bounds=Box())


def test_a_plain_law_in_the_same_loop() -> None:
    ocp = cart()
    law = FeedbackLaw(law=lambda x, t: [-5.0 * x[0] - 3.0 * x[1]], bounds=ocp.control_bounds)
    rollout = closed_loop(law, Plant(ocp=ocp), START, 5.0, dt=DT).or_raise()
    assert set(rollout.sources) == {InputSource.FEASIBLE}
    assert np.abs(rollout.x[-1]).max() < 0.05
    assert rollout.clipped[0] == pytest.approx(3.0)
    wrong = closed_loop(FeedbackLaw(law=lambda x, t: [np.nan]), Plant(ocp=ocp), START, 1.0, dt=DT)
    with pytest.raises(SolverError, match=r"ended at t = 0 s.*the law returned"):
        wrong.or_raise()


def test_a_robot_takes_joint_velocities() -> None:
    arm, start = PlanarArm((1.0, 1.0, 1.0)), np.array([2.0, -1.0, -1.0])
    path = line(np.array(arm.end_effector(start)).ravel(), (-0.5, 0.0))
    ocp = redundancy_ocp(arm, path, theta0=start, horizon=0.3, correction=20.0)
    plant = Plant(
        ocp=redundancy_ocp(arm, path, theta0=start, horizon=0.3, form="velocity"),
        measurement_noise=1e-3,
    )
    applied = PlantInput("rate", Box(-5.0, 5.0))
    mpc = MPC(ocp=ocp, solver=MultipleShooting(15), dt=0.02, applied=applied)
    rollout = mpc.run(plant, start, 1.0, seed=3).or_raise()
    assert rollout.drift < 5e-3, "with the correction noise leaves no offset"
    plain = MPC(
        ocp=replace_correction(arm, path, start), solver=mpc.solver, dt=0.02, applied=applied
    )
    assert plain.run(plant, start, 1.0, seed=3).drift < 0.1


def replace_correction(arm, path, start):
    return redundancy_ocp(arm, path, theta0=start, horizon=0.3, correction=1.0)


# -- plants --------------------------------------------------------------------------------


@pytest.mark.slow
def test_noise_is_seeded() -> None:
    plant = Plant(ocp=cart(), measurement_noise=[0.01, 0.02], process_noise=0.05, jitter=0.2)
    one, same, other = (driver().run(plant, START, 1.0, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.x, same.x)
    np.testing.assert_array_equal(one.t, same.t)
    assert not np.allclose(one.x, other.x)


@pytest.mark.parametrize(
    "plant",
    [
        Plant(ocp=cart(mass=1.3)),
        Plant(ocp=cart(mass=0.7)),
        Plant(ocp=cart(), lag=0.05),
        Plant(ocp=cart(), disturbance=lambda t: [0.3]),
        Plant(ocp=cart(), saturation=Box(-1.0, 1.0)),
    ],
    ids=["heavy", "light", "lag", "load", "weak"],
)
def test_a_plant_that_is_not_the_model_is_still_brought_home(plant) -> None:
    rollout = driver().run(plant, START, 6.0).or_raise()
    assert np.abs(rollout.x[-1]).max() < 0.1
    assert np.abs(rollout.inputs).max() <= 2.0


def test_the_cost_is_that_of_the_plants_own_trajectory() -> None:
    """One plan followed to its end: the loop's cost is the referee's of that plan."""
    ocp = cart()
    plan = solve(ocp, MultipleShooting(10))
    law = FeedbackLaw(law=lambda x, t: plan.control(t + 1e-9))
    rollout = closed_loop(law, Plant(ocp=ocp, substeps=20), START, 1.0, dt=DT)
    end = float(ocp.functions.terminal_cost(rollout.x[-1], 1.0, []))
    assert rollout.cost + end == pytest.approx(plan.cost, rel=1e-5)


# -- delay -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_compensation_takes_the_loss_of_a_delay_away() -> None:
    plant = Plant(ocp=cart())
    prompt = driver().run(plant, START, 3.0).cost
    late = {
        on: closed_loop(
            driver(delay=2 * DT, compensate=on), plant, START, 3.0, dt=DT, head_start=True
        )
        for on in (True, False)
    }
    # The first input is there in time; the plan it is the first of looks as far as any.
    assert late[True].cost == pytest.approx(prompt, rel=1e-6)
    assert late[False].cost > 1.05 * prompt
    assert late[True].decisions[0].applies_at == pytest.approx(2 * DT)


def test_without_a_head_start_the_initial_input_acts_and_is_reckoned_with() -> None:
    """What acts in the meantime is part of the prediction, from the first step on."""
    seen = []
    law = FeedbackLaw(law=lambda x, t: [0.0], delay=2 * DT)
    pushed = closed_loop(law, Plant(ocp=cart()), START, 2 * DT, dt=DT, initial_input=[1.5])
    mpc = driver(delay=2 * DT)
    loop = closed_loop(
        mpc, Plant(ocp=cart()), START, 1.0, dt=DT, initial_input=[1.5],
        watch=lambda told, decision: seen.append(decision),
    )  # fmt: skip
    np.testing.assert_array_equal(loop.inputs[:2], 1.5)
    np.testing.assert_allclose(seen[0].plan.x[0], pushed.x[-1], atol=1e-6)


def test_a_head_start_asks_before_the_plant_moves() -> None:
    asked = []

    def law(x: np.ndarray, t: float) -> list[float]:
        asked.append((t, x.copy()))
        return [0.5]

    loop = closed_loop(
        FeedbackLaw(law=law, delay=2 * DT), Plant(ocp=cart()), START, 3 * DT, dt=DT, head_start=True
    )
    np.testing.assert_allclose([t for t, _ in asked], DT * np.arange(-2, 3), atol=1e-12)
    for _, x in asked[:3]:
        np.testing.assert_array_equal(x, START)
    np.testing.assert_array_equal(loop.inputs, 0.5)
    assert len(loop.decisions) == 3
    assert [loop.acting(k) for k in range(3)] == [None, None, InputSource.FEASIBLE]

    def refuses(x: np.ndarray, t: float) -> list[float]:
        return [np.nan]

    ended = closed_loop(
        FeedbackLaw(law=refuses, delay=DT), Plant(ocp=cart()), START, DT, dt=DT, head_start=True
    )
    assert len(ended.inputs) == 0
    assert "the law returned" in ended.ended
    with pytest.raises(ProblemError, match=r"plot: the loop has no step; it ended: .*the law"):
        ended.plot()


# -- what is kept ------------------------------------------------------------------------------


def test_a_rollout_is_saved_and_read(tmp_path: Path) -> None:
    rollout = driver().run(Plant(ocp=cart()), START, 0.5)
    back = Rollout.load(rollout.save(tmp_path / "loop"), cart())
    np.testing.assert_array_equal(back.x, rollout.x)
    assert back.sources == rollout.sources
    assert back.messages == rollout.messages
    assert back.cost == rollout.cost
    with pytest.raises(ProblemError, match="is a loop with 'cart'"):
        Rollout.load(tmp_path / "loop.npz", unconstrained_named())
    (tmp_path / "no.npz").write_bytes(b"nothing")
    with pytest.raises(ProblemError, match="no saved rollout"):
        Rollout.load(tmp_path / "no.npz", cart())


def test_a_rollout_of_another_plant_of_the_same_name_is_refused(tmp_path: Path) -> None:
    loop = driver().run(Plant(ocp=cart()), START, 0.5)
    with pytest.raises(ProblemError, match="is a loop with another 'cart': dynamics"):
        Rollout.load(loop.save(tmp_path / "loop"), cart(mass=2.0))
    with pytest.raises(ProblemError, match="the plant that"):
        Rollout.load(tmp_path / "loop.npz", "cart")  # pyright: ignore[reportArgumentType]


def test_what_acts_during_the_delay_can_be_held() -> None:
    mpc = driver(delay=2 * DT, backup="hold")
    blind = closed_loop(
        mpc, Plant(ocp=cart()), START, 3 * DT, dt=DT, initial_input=[0.7],
        sensors=lambda x, t: np.full_like(x, np.nan),
    )  # fmt: skip
    np.testing.assert_array_equal(blind.or_raise().inputs, 0.7)
    prompt = closed_loop(
        driver(backup="hold"), Plant(ocp=cart()), START, DT, dt=DT,
        sensors=lambda x, t: np.full_like(x, np.nan),
    )  # fmt: skip
    assert "no input to hold" in prompt.ended


def test_a_flight_record_is_of_one_run(tmp_path: Path) -> None:
    mpc = driver()
    with FlightRecorder(mpc, tmp_path / "flight") as recorder:
        mpc.run(Plant(ocp=cart()), START, 0.3, watch=recorder.watch)
        with pytest.raises(ProblemError, match="t goes back to 0 s; a record is of one run"):
            mpc.run(Plant(ocp=cart()), START, 0.3, watch=recorder.watch)


def unconstrained_named():
    return replace(cart(), name="another")


def test_a_rollout_is_drawn(tmp_path: Path) -> None:
    script = {0.2: lambda s: s.with_(u=s.u + 9.0)}
    mpc = MPC(ocp=cart(), solver=scripted(script), dt=DT)
    figure = mpc.run(Plant(ocp=cart()), START, 0.5).plot()
    assert "shifted (1 of 5)" in [t.get_text() for t in figure.legends[0].get_texts()]
    figure.savefig(tmp_path / "loop.png")


@pytest.mark.many
@pytest.mark.parametrize("delay", [0.0, DT])
def test_every_recorded_step_replays_to_the_last_bit(tmp_path: Path, delay: float) -> None:
    script = {round(t + delay, 2): lambda s: s.with_(u=s.u + 9.0) for t in (0.2, 0.3)}
    mpc = MPC(ocp=cart(), solver=scripted(script), dt=DT, delay=delay, backup=lambda x, t: [-x[0]])
    plant = Plant(ocp=cart(mass=1.2), measurement_noise=0.01)
    file = tmp_path / "flight"
    with FlightRecorder(mpc, file) as recorder:
        rollout = mpc.run(plant, START, 0.8, watch=recorder.watch)
    found = list(records(file))
    assert [record.source for record in found] == list(rollout.sources)
    assert rollout.sources.count(InputSource.SHIFTED) == 2
    assert all(replay(mpc, file, k).is_exact for k in range(len(found)))
    with pytest.raises(ProblemError, match="has no step 8"):
        replay(mpc, file, 8)
    with pytest.raises(ProblemError, match="records the solver"):
        replay(driver(), file, 0)


def test_a_refusal_is_recorded_and_refused_again(tmp_path: Path) -> None:
    def fails(solution: Solution) -> Solution:
        return solution.with_(status=Status.FAILED, message="as the script says")

    mpc = MPC(ocp=cart(), solver=scripted({0.1: fails}), dt=DT, backup="hold")
    file = tmp_path / "flight"
    with FlightRecorder(mpc, file) as recorder:
        # A late plan outlives its own step, in the replay too: the third step follows it.
        for k, (x, late) in enumerate([([1.0, 0.0], True), ([np.nan, 0.0], False), (START, True)]):
            mpc_step(mpc, recorder, np.array(x), k * DT, late)
    first, second, third = records(file)
    assert (first.source, first.input, first.status) == (None, None, Status.SOLVED)
    assert "too late for its step; there is no earlier plan" in first.message
    assert first.plan is not None
    assert (second.source, third.source) == (InputSource.SHIFTED, InputSource.SHIFTED)
    assert [step.is_exact for step in replay_all(mpc, file, range(3))] == [True] * 3


def mpc_step(mpc: MPC, recorder: FlightRecorder, x: np.ndarray, t: float, late: bool) -> None:
    try:
        recorder.watch(x, mpc.step(x, t, late=late))
    except ControlRefused as refusal:
        recorder.watch(x, refusal)


@pytest.mark.slow
def test_a_loop_records_the_refusal_that_ends_it(tmp_path: Path) -> None:
    fails = {0.3: lambda s: s.with_(status=Status.FAILED, message="as the script says")}
    mpc = MPC(ocp=cart(), solver=scripted(fails), dt=DT, backup=lambda x, t: [np.nan])
    jumps = Plant(ocp=cart(), disturbance=lambda t: [80.0 if 0.2 <= t < 0.29 else 0.0])
    with FlightRecorder(mpc, tmp_path / "flight") as recorder:
        rollout = mpc.run(jumps, START, 1.0, watch=recorder.watch)
    assert "FAILED" in rollout.ended
    found = list(records(tmp_path / "flight"))
    assert [r.source for r in found] == [InputSource.OPTIMAL] * 3 + [None]
    assert found[3].message in rollout.ended
    assert all(step.is_exact for step in replay_all(mpc, tmp_path / "flight", range(4)))
    # Whoever has a backup law now does not refuse: that is no exact replay.
    helped = replace(mpc, backup=lambda x, t: [0.0])
    assert not replay(helped, tmp_path / "flight", 3).is_exact


def test_a_law_that_refuses_is_no_flight(tmp_path: Path) -> None:
    with (
        FlightRecorder(driver(), tmp_path / "flight") as recorder,
        pytest.raises(ProblemError, match="refusal of a controller that is no MPC"),
    ):
        recorder.watch(np.zeros(2), ControlRefused("the law said no"))


def test_a_solver_that_remembers_replays_from_the_start(tmp_path: Path) -> None:
    ocp = discretise(cart_without_path(), dt=0.05)
    mpc = MPC(ocp=ocp, solver=LinearMPC(), dt=0.05)
    assert mpc.is_stateful
    with FlightRecorder(mpc, tmp_path / "flight") as recorder:
        mpc.run(Plant(ocp=ocp, measurement_noise=0.01), START, 1.0, watch=recorder.watch)
    assert replay(mpc, tmp_path / "flight", 17).is_exact


def cart_without_path():
    return replace(cart(), constraints=())


def test_a_record_that_was_cut_off_is_ignored(tmp_path: Path) -> None:
    mpc, file = driver(), tmp_path / "flight"
    with FlightRecorder(mpc, file) as recorder:
        mpc.run(Plant(ocp=cart()), START, 0.5, watch=recorder.watch)
    whole = file.read_bytes()
    file.write_bytes(whole[:-20])
    assert len(list(records(file))) == 4
    assert replay(mpc, file, 3).is_exact
    file.write_bytes(b"something else\n")
    with pytest.raises(ProblemError, match="no flight record"):
        list(records(file))


# -- bad input -----------------------------------------------------------------------------------


def test_what_does_not_fit_is_said() -> None:
    with pytest.raises(ProblemError, match="no multiple of dt"):
        driver().run(Plant(ocp=cart()), START, 0.55)
    with pytest.raises(ProblemError, match="plant: x0 has 3 entries"):
        driver().run(Plant(ocp=cart()), [1.0, 0.0, 0.0], 0.5)
    two = FeedbackLaw(law=lambda x, t: [0.0, 0.0])
    with pytest.raises(ProblemError, match="sends 2 inputs, the plant 'cart' takes 1"):
        closed_loop(two, Plant(ocp=cart()), START, 0.5, dt=DT)
    bad_plants: tuple[dict[str, Any], ...] = (
        {"lag": -1.0},
        {"jitter": 1.0},
        {"substeps": 0},
        {"measurement_noise": [1, 2, 3]},
    )
    for bad in bad_plants:
        with pytest.raises(ProblemError, match="plant"):
            Plant(ocp=cart(), **bad)
    with pytest.raises(ProblemError, match=r"dt = 0\.1 s, but the model's step"):
        MPC(ocp=discretise(cart_without_path(), dt=0.05), solver=LinearMPC(), dt=0.1)
