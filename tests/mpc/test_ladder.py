"""The driver never lies and never stops: every rung of the ladder, and the way back."""

from dataclasses import dataclass, field, replace
from pathlib import Path
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
    ControlRefused,
    FlightRecorder,
    InitialGuess,
    InputSource,
    Model,
    Plant,
    PlantInput,
    ProblemError,
    Program,
    Solution,
    Solver,
    Status,
    replay_all,
)
from solvers import IndirectShooting, MultipleShooting
from tests.mpc.problems import FASTEST, LIMIT, Change, cart, is_an_input, scripted

DT = 0.1


def raises(error: Exception) -> Change:
    def change(solution: Solution) -> Solution:
        raise error

    return change


def becomes(status: Status) -> Change:
    return lambda solution: solution.with_(status=status, message="as the script says")


def leaves_bounds(by: float) -> Change:
    return lambda solution: solution.with_(u=np.full_like(solution.u, LIMIT + by))


def controller(script: dict[float, Change] | None = None, **options) -> MPC:
    return MPC(ocp=cart(), solver=scripted(script or {}), dt=DT, **options)


def loop(mpc: MPC, duration: float = 1.0):
    return mpc.run(Plant(ocp=mpc.ocp), [1.0, 0.0], duration)


def test_without_faults_every_decision_is_optimal_and_the_cart_arrives() -> None:
    rollout = loop(controller(), 4.0).or_raise()
    assert set(rollout.sources) == {InputSource.OPTIMAL}
    assert not any(rollout.messages)
    assert np.abs(rollout.x[-1]).max() < 1e-2
    assert rollout.violation < 1e-6


@pytest.mark.many
@pytest.mark.parametrize(
    ("change", "word"),
    [
        (raises(RuntimeError("as the script says")), "RuntimeError inside the solver"),
        (raises(ZeroDivisionError("as the script says")), "ZeroDivisionError inside the solver"),
        (becomes(Status.FAILED), "FAILED"),
        (becomes(Status.DIVERGED), "DIVERGED"),
        (leaves_bounds(1e-3), "bound of u"),
    ],
)
def test_a_failure_takes_the_shifted_plan_and_names_itself(change: Change, word: str) -> None:
    rollout = loop(controller({0.3: change, 0.4: change}))
    expected = [InputSource.OPTIMAL] * 10
    expected[3] = expected[4] = InputSource.SHIFTED
    assert list(rollout.sources) == expected, "it recovers when the fault ends"
    assert word in rollout.messages[3]
    assert [d.age for d in rollout.decisions[2:6]] == [0, 1, 2, 0]
    undisturbed = loop(controller())
    # Plant and model agree, so following the old plan for two steps changes next to nothing.
    assert rollout.cost == pytest.approx(undisturbed.cost, rel=1e-3)


@dataclass(frozen=True)
class Watched(Solver):
    """Notes what each run starts from."""

    inner: Solver
    seen: list[InitialGuess | None] = field(default_factory=list)

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "Watched":
        """Set what is left open; see ``Solver``."""
        inner = self.inner.for_control_loop(compiled=compiled, time_limit=time_limit)
        return replace(self, inner=inner)

    def build(self, ocp: OCP) -> "WatchedProgram":
        return WatchedProgram(self.seen, self.inner.build(ocp))


@dataclass(frozen=True, eq=False)
class WatchedProgram(Program):
    seen: list[InitialGuess | None]
    inner: Program

    def run(self, *, guess: InitialGuess | None = None, **data) -> Solution:
        self.seen.append(guess)
        return self.inner.run(guess=guess, **data)


def test_a_plan_that_leads_astray_is_no_start_for_ever() -> None:
    """A failure may be an accident; after two, every other run starts as the first step does."""
    bad = {round(DT * k, 2): becomes(Status.DIVERGED) for k in (2, 3, 4, 5, 6, 8)}
    watched = Watched(scripted(bad))
    mpc = MPC(ocp=cart(), solver=watched, dt=DT)
    rollout = loop(mpc, 1.2)
    assert [k for k, guess in enumerate(watched.seen) if guess is None] == [0, 4, 6]
    assert rollout.sources[7] is InputSource.OPTIMAL


@pytest.mark.slow
def test_a_start_afresh_is_replayed(tmp_path: Path) -> None:
    """From its own guess the solver takes other iterations, and ends at other last digits."""
    bad = {round(DT * k, 2): becomes(Status.ITERATION_LIMIT) for k in (2, 3, 4)}
    script = {**bad, 0.2: becomes(Status.DIVERGED), 0.3: raises(RuntimeError("as the script says"))}
    mpc = controller(script)
    with FlightRecorder(mpc, tmp_path / "flight") as recorder:
        mpc.run(Plant(ocp=mpc.ocp, measurement_noise=1e-3), [1.0, 0.0], 0.8, watch=recorder.watch)
    assert all(again.is_exact for again in replay_all(mpc, tmp_path / "flight", range(8)))


def test_what_is_not_measured_is_no_failure_of_the_plan() -> None:
    watched = Watched(scripted({}))
    mpc = MPC(ocp=cart(), solver=watched, dt=DT)
    mpc.step([1.0, 0.0], 0.0)
    for k in (1, 2):
        mpc.step([np.nan, 0.0], DT * k)
    mpc.step([0.9, -0.3], 3 * DT)
    assert [guess is None for guess in watched.seen] == [True, False]


@pytest.mark.slow
def test_a_solver_without_a_limit_gets_one_wherever_it_is() -> None:
    def used(solver: Solver) -> Any:
        mpc = MPC(ocp=cart(), solver=solver, dt=DT, compiled=False)
        assert mpc.solver is solver
        program: Any = mpc._ladder.program
        return program.solver

    plain = MultipleShooting(10)
    in_a_loop = replace(plain, feasibility_restoration=False)
    assert used(plain) == replace(in_a_loop, time_limit=10.0)
    for limit in (0.5, np.inf):
        assert used(replace(plain, time_limit=limit)).time_limit == limit
    assert used(scripted({})).inner == replace(in_a_loop, time_limit=10.0)
    assert plain.for_control_loop(compiled=True, time_limit=10.0) == replace(
        in_a_loop, time_limit=10.0, compiled=True
    )
    shooting = IndirectShooting()
    assert shooting.for_control_loop(compiled=False, time_limit=10.0) == shooting


def test_a_small_excess_is_clipped_and_recorded() -> None:
    rollout = loop(controller({0.3: leaves_bounds(1e-7)}))
    assert rollout.sources[3] is InputSource.OPTIMAL
    assert rollout.inputs[3] == LIMIT
    assert rollout.clipped[3] == pytest.approx(1e-7)


def test_an_input_without_bounds_must_still_be_finite() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    model = Model(name="steep", x=x, u=u, f=ca.exp(u) - 1.0)
    ocp = OCP(name="steep", model=model, x0=[1.0], horizon=1.0, running_cost=x**2 + u**2)
    solver = scripted({0.0: lambda solution: solution.with_(u=np.full_like(solution.u, 1e3))})
    mpc = MPC(ocp=ocp, solver=solver, dt=DT, applied=PlantInput("rate"), backup=None)
    with (
        np.errstate(invalid="ignore"),
        pytest.raises(ControlRefused, match=r"the input \[inf\] is not finite"),
    ):
        mpc.step([1.0], 0.0)


def test_who_changes_an_input_changes_no_plan() -> None:
    decision = controller().step([1.0, 0.0], 0.0)
    assert decision.plan is not None
    first = decision.plan.u[0].copy()
    decision.input[:] = 0.123
    np.testing.assert_array_equal(decision.plan.u[0], first)


@pytest.mark.slow
def test_an_answer_that_is_not_optimal_is_tried_on_the_model_first() -> None:
    good = loop(controller({0.3: becomes(Status.ITERATION_LIMIT)}))
    assert good.sources[3] is InputSource.FEASIBLE
    assert "ITERATION_LIMIT" in good.messages[3]

    def too_fast(solution: Solution) -> Solution:
        # From the start the cart would exceed its greatest speed under this.
        u = np.full_like(solution.u, -LIMIT)
        return solution.with_(u=u, status=Status.ITERATION_LIMIT, message="")

    bad = loop(controller({0.3: too_fast}))
    assert bad.sources[3] is InputSource.SHIFTED
    assert "'speed' is violated" in bad.messages[3]


@pytest.mark.many
@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
@pytest.mark.parametrize("as_bound", [True, False], ids=["bound", "constraint"])
def test_noise_at_an_active_state_constraint_passes(as_bound: bool, backend) -> None:
    """The measured speed is beyond its limit at some steps: nobody can change it any more."""
    ocp = cart()
    if as_bound:
        limit = Box([-np.inf, -FASTEST], [np.inf, FASTEST])
        ocp = replace(ocp, constraints=(), state_bounds=limit)
    solver = MultipleShooting(10, backend=backend)
    mpc = MPC(ocp=ocp, solver=solver, dt=DT, backup=lambda x, t: [0.0])
    plant = Plant(ocp=ocp, measurement_noise=[0.0, 0.02])
    rollout = mpc.run(plant, [4.0, 0.0], 3.0, seed=1).or_raise()
    outside = np.abs(rollout.measured[:, 1]) > FASTEST + 1e-6
    assert outside.sum() >= 5
    for k, decision in enumerate(rollout.decisions):
        assert decision.source is (InputSource.FEASIBLE if outside[k] else InputSource.OPTIMAL)
        assert ("by the given start itself" in decision.message) == outside[k]
        assert decision.age == 0, "every step has a plan of its own"
    assert rollout.violation < 0.1


def test_an_infeasible_plan_that_misses_its_end_is_not_followed() -> None:
    """Along the way it meets everything; the end that it cannot reach is a constraint too."""
    ocp = cart()
    there = Constraint("there", ocp.model.x[0], -3.0, -2.9, at="terminal")
    asked = replace(ocp, constraints=(there,))
    for follows, source in ((True, InputSource.LEAST_VIOLATING), (False, InputSource.BACKUP)):
        mpc = MPC(ocp=asked, solver=MultipleShooting(10), dt=DT, backup=lambda x, t: [0.0],
                  least_violating=follows)  # fmt: skip
        decision = mpc.step([1.0, 0.0], 0.0)
        assert decision.status is not Status.SOLVED
        assert decision.source is source
        assert ("'there' is violated" in decision.message) is follows


def test_when_the_plan_is_used_up_the_backup_law_takes_over() -> None:
    script = {round(k * DT, 2): becomes(Status.FAILED) for k in range(2, 30)}
    mpc = controller(script, backup=lambda x, t: [-x[0] - 2.0 * x[1]])
    rollout = loop(mpc, 3.0)
    assert rollout.sources[:2] == (InputSource.OPTIMAL,) * 2
    assert set(rollout.sources[2:11]) == {InputSource.SHIFTED}
    assert set(rollout.sources[11:]) == {InputSource.BACKUP}
    assert "nothing is left of it" in rollout.messages[-1]
    assert np.abs(rollout.x[-1]).max() < 0.2


def test_where_that_is_the_choice_the_last_input_is_held() -> None:
    script = {round(k * DT, 2): becomes(Status.FAILED) for k in range(2, 30)}
    rollout = loop(controller(script, backup="hold"), 1.5)
    assert set(rollout.sources[11:]) == {InputSource.BACKUP}
    assert rollout.messages[-1].endswith("backup: hold")
    assert (rollout.inputs[11:] == rollout.inputs[10]).all()


@pytest.mark.parametrize("law", [None, lambda x, t: [np.nan], lambda x, t: [1.0, 2.0]])
def test_with_nothing_to_answer_for_it_refuses(law) -> None:
    mpc = controller({0.0: becomes(Status.FAILED)}, backup=law)
    with pytest.raises(ControlRefused, match=r"FAILED: as the script says; there is no earlier"):
        mpc.step([1.0, 0.0], 0.0)
    rollout = loop(mpc)
    assert len(rollout.inputs) == 0
    assert "FAILED" in rollout.ended


def test_the_backup_law_is_saturated() -> None:
    mpc = controller({0.0: becomes(Status.FAILED)}, backup=lambda x, t: [100.0])
    decision = mpc.step([1.0, 0.0], 0.0)
    assert decision.input == LIMIT
    assert decision.clipped == pytest.approx(98.0)


def test_a_missing_measurement_is_no_state() -> None:
    mpc = controller()
    mpc.step([1.0, 0.0], 0.0)
    decision = mpc.step([np.nan, 0.0], DT)
    assert decision.source is InputSource.SHIFTED
    assert "the measurement is not finite" in decision.message
    assert mpc.step([0.9, -0.2], 2 * DT).source is InputSource.OPTIMAL


def test_late_answers_are_kept_for_later() -> None:
    mpc = controller(backup="hold")
    first = mpc.step([1.0, 0.0], 0.0)
    late = mpc.step([0.99, -0.2], DT, late=True)
    assert late.source is InputSource.SHIFTED
    assert late.late
    assert late.plan is first.plan
    assert mpc.state.plan is not first.plan
    slow = replace(mpc, budget=1e-9)
    with pytest.raises(ControlRefused, match="too late for its step"):
        slow.step([1.0, 0.0], 0.0)


def test_a_late_plan_outlives_the_refusal_of_its_step() -> None:
    mpc = controller(backup="hold")
    with pytest.raises(ControlRefused, match="too late") as refused:
        mpc.step([1.0, 0.0], 0.0, late=True)
    report = refused.value.report
    assert report is not None
    assert report.late
    assert report.status is Status.SOLVED
    decision = mpc.step([np.nan, 0.0], DT)
    assert decision.source is InputSource.SHIFTED, "the late plan is the last one"
    assert decision.age == 1


faults = st.sampled_from(
    [
        raises(RuntimeError("no")),
        raises(ValueError("no")),
        becomes(Status.INFEASIBLE),
        becomes(Status.ITERATION_LIMIT),
        becomes(Status.NO_PROGRESS),
        leaves_bounds(1e-8),
        leaves_bounds(1.0),
        lambda solution: solution.with_(x=10.0 * solution.x),
    ]
)
jumps = st.sampled_from([[0.0, 0.0], [np.nan, 0.0], [5.0, 0.0], [0.0, -3.0], [np.inf, np.nan]])


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    script=st.dictionaries(st.integers(0, 14), faults, max_size=10),
    sensors=st.dictionaries(st.integers(1, 14), jumps, max_size=8),
)
def test_whatever_fails_no_input_is_out_of_bounds(script, sensors) -> None:
    mpc = SHARED
    SCRIPT.clear()
    SCRIPT.update({round(k * DT, 2): change for k, change in script.items()})
    mpc.reset()
    x = np.array([1.0, 0.0])
    for k in range(15):
        told = x + sensors.get(k, [0.0, 0.0])
        try:
            decision = mpc.step(told, k * DT)
        except ControlRefused:
            assert mpc.state.plan is None, "it refuses where it knows neither plan nor state"
            assert not np.isfinite(told).all()
            continue
        assert is_an_input(decision.input)
        assert (decision.source is InputSource.OPTIMAL) or decision.message
        x = x + DT * np.array([x[1], decision.input[0]])


# Built once for all examples; each writes its own script.
SCRIPT: dict[float, Change] = {}
SHARED = MPC(
    ocp=cart(),
    solver=scripted(SCRIPT),
    dt=DT,
    backup=lambda x, t: [-3.0 * x[0] - 3.0 * x[1]],
)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"dt": 0.0}, r"dt \[s\] = 0.0"),
        ({"dt": np.nan}, r"dt \[s\] = nan"),
        ({"dt": 2.0}, "longer than the horizon"),
        ({"dt": 0.1, "delay": 0.15}, "no multiple"),
        ({"dt": 0.1, "delay": -0.1}, r"delay \[s\] = -0.1, it must be 0 or more"),
        ({"dt": 0.1, "budget": 0.0}, "budget"),
        ({"dt": 0.1, "tolerance": -1.0}, "tolerance"),
    ],
)
def test_bad_options(options, word) -> None:
    with pytest.raises(ProblemError, match=word):
        MPC(ocp=cart(), solver=MultipleShooting(10), **options)


@pytest.mark.parametrize("x", [[1.0], [[1.0, 0.0]], [1.0, 0.0, 0.0]])
def test_a_state_of_a_wrong_shape(x) -> None:
    with pytest.raises(ProblemError, match="shape"):
        controller().step(x, 0.0)


def test_bounds_of_a_control_are_the_problems() -> None:
    with pytest.raises(ProblemError, match="those of the problem"):
        PlantInput("control", Box(-1, 1))
