"""No sample, callback, solver or file stops the loop, and each failure has its reason."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from benchmarks.mpc.altered import Altered
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
    Program,
    Rate,
    Rollout,
    Solution,
    Solver,
    Status,
    closed_loop,
    replay_all,
)
from solvers import Collocation, LinearMPC, MultipleShooting, StagewiseNewton
from tests.mpc.problems import LIMIT, cart, scripted

DT = 0.1


class SensorError(Exception):
    """What some driver raises."""


def controller(solver: Solver | None = None, **options) -> MPC:
    return MPC(
        ocp=options.pop("ocp", cart()), solver=solver or MultipleShooting(10), dt=DT, **options
    )


# -- samples --------------------------------------------------------------------------------------

LOUD = 3.4028235e38
LINEAR = OCP(
    name="cart",
    model=Model(
        name="cart",
        x=(_x := ca.SX.sym("x", 2)),
        u=(_u := ca.SX.sym("u")),
        f=ca.vertcat(_x[0] + DT * _x[1], _x[1] + DT * _u),
        dt=DT,
    ),
    x0=[1.0, 0.0],
    horizon=15,
    running_cost=10 * _x[0] ** 2 + _x[1] ** 2 + 0.1 * _u**2,
    control_bounds=Box(-2.0, 2.0),
)


@pytest.mark.parametrize(
    "sample", [[LOUD, 0.0], [0.0, -LOUD], [1e12, 1e12], [np.nan, 0.0]], ids=str
)
@pytest.mark.parametrize(
    "solver",
    [
        LinearMPC(),
        LinearMPC("highs"),
        StagewiseNewton(15),
        MultipleShooting(15),
        MultipleShooting(15, backend="fatrop"),
    ],
    ids=repr,
)
def test_an_absurd_sample_costs_its_step(solver: Solver, sample: list[float]) -> None:
    limited = replace(LINEAR, state_bounds=Box([-9.0, -0.6], [9.0, 0.6]))
    asked = LINEAR if isinstance(solver, StagewiseNewton) else limited
    mpc = controller(solver, ocp=asked)
    assert mpc.step([1.0, 0.0], 0.0).source is InputSource.OPTIMAL
    lost = mpc.step(sample, DT)
    assert lost.source is InputSource.SHIFTED
    assert "measurement" in lost.message
    for k in range(2, 5):
        assert mpc.step([1.0, 0.0], k * DT).source is InputSource.OPTIMAL
    mpc.reset()
    if not np.abs(sample).max() < 1e20:  # smaller ones may be where a problem is used
        with pytest.raises(ControlRefused):
            mpc.step(sample, 0.0)
    assert mpc.step([1.0, 0.0], DT).source is InputSource.OPTIMAL


def test_an_outlier_is_no_warm_start() -> None:
    """Far but possible: its plan is followed for a step, and not begun from."""
    told, alone = (controller(StagewiseNewton(15), ocp=LINEAR) for _ in range(2))
    for k in range(6):
        z = [1.0, 0.0]
        other = told.step([1e6, 0.0] if k == 2 else z, k * DT)
        same = alone.step(z, k * DT)
        if k != 2:
            np.testing.assert_allclose(other.input, same.input, atol=1e-9)


def test_a_problem_may_be_used_far_from_where_it_is_declared() -> None:
    """Declared at 1e-9, a measurement of 30 could not be meant."""
    mpc, z = controller(ocp=replace(cart(), x0=[1e-9, 0.0])), [30.0, 0.0]
    for k in range(5):
        decided = mpc.step(z, k * DT)
        assert "cannot be meant" not in decided.message


@pytest.mark.parametrize("solver", [LinearMPC(), MultipleShooting()], ids=repr)
def test_without_measurements_an_actuator_is_known_by_what_was_sent(solver: Solver) -> None:
    """A law that asks for nine times its bound leads there at the rate that is allowed."""
    bounded = replace(LINEAR, control_bounds=Box(-1.0, 1.0))
    slow = replace(bounded, rates=(Rate(_u, -0.5, 0.5),), last_input=[0.0])
    for whole in (0, 1):
        mpc, force = controller(solver, ocp=slow, backup=lambda x, t: [9.0]), 0.0
        for k in range(30):
            decided = mpc.step([0.1, 0.0] if k < whole else [np.nan] * 2, k * DT)
            assert decided.message or k < whole
            assert abs(decided.input[0] - force) <= 0.5 + 1e-9
            force = decided.input[0]
            assert abs(force) <= 1.0


# -- solvers --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Strange(Solver):
    """Answers something else at some steps; a program that has raised raises for ever."""

    answers: dict[float, Any] = field(default_factory=dict)
    built: list[int] = field(default_factory=list)

    def build(self, ocp: OCP) -> Program:
        self.built.append(1)
        return StrangeProgram(self, MultipleShooting(10).unjudged().build(ocp))


@dataclass(eq=False)
class StrangeProgram(Program):
    solver: Strange
    inner: Program
    broken: bool = False

    def run(self, *, x0=None, t0=0.0, parameters=None, guess=None) -> Solution:
        found = self.inner.run(x0=x0, t0=t0, parameters=parameters, guess=guess)
        answer = self.solver.answers.get(round(t0, 2))
        if isinstance(answer, Exception) or self.broken:
            self.broken = True
            raise answer or RuntimeError("still broken")
        return answer(found) if isinstance(answer, Callable) else found


ELSEWHERE = {
    "another problem": (lambda s: s.with_(problem=cart(mass=2.0)), "another problem"),
    "another time": (lambda s: s.with_(t=s.t + 5.0), "begins at"),
    "another start": (lambda s: s.with_(x=s.x + 1.0), "begins at"),
    "another length": (lambda s: s.with_(t=s.t[0] + 2 * (s.t - s.t[0])), "long"),
    "nothing": (lambda s: None, "no solution"),
}


@pytest.mark.parametrize(("change", "said"), ELSEWHERE.values(), ids=list(ELSEWHERE))
def test_a_plan_of_something_else_is_refused(change, said: str) -> None:
    mpc = controller(Strange({0.1: change}))
    assert mpc.step([1.0, 0.0], 0.0).source is InputSource.OPTIMAL
    refused = mpc.step([1.0, 0.0], 0.1)
    assert refused.source is InputSource.SHIFTED
    assert said in refused.message
    assert mpc.step([1.0, 0.0], 0.2).source is InputSource.OPTIMAL


@pytest.mark.parametrize("error", [SensorError("loose"), OSError(28, "disk"), TypeError("bug")])
def test_a_solver_that_raised_is_built_again(error: Exception) -> None:
    solver = Strange({0.1: error})
    mpc = controller(solver)
    mpc.step([1.0, 0.0], 0.0)
    failed = mpc.step([1.0, 0.0], 0.1)
    assert failed.source is InputSource.SHIFTED
    assert type(error).__name__ in failed.message
    assert mpc.step([1.0, 0.0], 0.2).source is InputSource.OPTIMAL
    assert len(solver.built) == 2
    mpc.step([1.0, 0.0], 0.1)
    mpc.reset()
    assert mpc.step([1.0, 0.0], 0.0).source is InputSource.OPTIMAL


def test_a_solver_that_cannot_be_built_again_costs_steps_only(monkeypatch) -> None:
    mpc, builds = controller(Strange({0.1: RuntimeError("gone")})), []
    mpc.step([1.0, 0.0], 0.0)
    mpc.step([1.0, 0.0], 0.1)
    build = Strange.build

    def full(solver: Strange, ocp: OCP) -> Program:
        builds.append(1)
        if len(builds) < 3:
            raise OSError(28, "No space left on device")
        return build(solver, ocp)

    monkeypatch.setattr(Strange, "build", full)
    for k in (2, 3):
        lost = mpc.step([1.0, 0.0], k * DT)
        assert lost.source is InputSource.SHIFTED
        assert "cannot be built again: OSError" in lost.message
    assert mpc.step([1.0, 0.0], 0.4).source is InputSource.OPTIMAL


def test_a_callback_that_calls_the_controller_is_refused_by_name() -> None:
    def parameters(t: float) -> Any:
        if t > 0.05:
            mpc.reset()
        return {"price": [0.2]}

    mpc = controller(ocp=priced(), parameters=parameters)
    mpc.step([1.0, 0.0], 0.0)
    said = mpc.step([1.0, 0.0], 0.1).message
    assert "step, reset or prepare_next is called inside a step" in said


def test_without_a_control_there_is_nothing_to_decide() -> None:
    x = ca.SX.sym("x")
    falling = Model(name="falling", x=x, u=ca.SX(0, 1), f=-x)
    alone = OCP(name="falling", model=falling, x0=[1.0], horizon=1.0, running_cost=x**2)
    decided = controller(ocp=alone).step([1.0], 0.0)
    assert decided.source is InputSource.OPTIMAL
    assert decided.input.shape == (0,)


def test_time_that_runs_backwards_leaves_no_earlier_plan() -> None:
    mpc = controller(Strange({0.0: ValueError("none today")}))
    mpc.step([1.0, 0.0], 5.0)
    back = mpc.step([1.0, 0.0], 0.0)
    assert back.source is InputSource.BACKUP
    assert "time went back" in back.message
    forward = mpc.step([1.0, 0.0], 0.1)
    assert forward.source is InputSource.OPTIMAL
    assert forward.age == 0


# -- callbacks ------------------------------------------------------------------------------------


def priced() -> OCP:
    plain, price = cart(), ca.SX.sym("price")
    return replace(
        plain,
        running_cost=plain.running_cost + price * plain.model.u**2,
        parameters=(Parameter("price", price, 0.1),),
    )


@pytest.mark.parametrize(
    "fault", [SensorError("loose"), ConnectionError("gone"), TypeError("x"), None], ids=repr
)
def test_parameters_that_fail_cost_a_step(fault: Exception | None) -> None:
    def parameters(t: float) -> Any:
        if round(t, 2) != 0.1:
            return {"price": [0.2]}
        if fault is None:
            return None
        raise fault

    mpc = controller(ocp=priced(), parameters=parameters)
    assert mpc.step([1.0, 0.0], 0.0).source is InputSource.OPTIMAL
    lost = mpc.step([1.0, 0.0], 0.1)
    assert lost.source is InputSource.SHIFTED
    assert "no parameters" in lost.message
    assert mpc.step([1.0, 0.0], 0.2).source is InputSource.OPTIMAL


def test_ctrl_c_comes_out_of_a_callback() -> None:
    def parameters(t: float) -> Any:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        controller(ocp=priced(), parameters=parameters).step([1.0, 0.0], 0.0)


def test_a_backup_law_may_raise_anything() -> None:
    def law(x: np.ndarray, t: float) -> Any:
        raise SensorError("loose")

    mpc = controller(scripted({0.0: lambda s: s.with_(x0=np.array([np.inf, 0]))}), backup=law)
    rollout = mpc.run(Plant(ocp=cart()), [1.0, 0.0], 0.1)
    assert "SensorError" in rollout.ended


# -- observers and sensors ------------------------------------------------------------------------


def test_a_full_disk_does_not_stop_the_loop() -> None:
    calls = []

    def watch(measured: np.ndarray, decided: object) -> None:
        calls.append(measured)
        if len(calls) == 3:
            raise OSError(28, "No space left on device")

    mpc = controller()
    with pytest.warns(RuntimeWarning, match="watched no more"):
        rollout = mpc.run(Plant(ocp=cart()), [1.0, 0.0], 1.0, watch=watch)
    assert len(rollout.inputs) == 10
    assert len(calls) == 3


def test_sensors_that_write_into_their_argument_do_not_move_the_plant() -> None:
    def sensors(measured: np.ndarray, t: float) -> np.ndarray:
        measured += 0.5
        return measured

    mpc, plant = controller(), Plant(ocp=cart())
    rollout = closed_loop(mpc, plant, [1.0, 0.0], 0.5, dt=DT, sensors=sensors)
    assert rollout.x[0, 0] == 1.0
    np.testing.assert_allclose(rollout.measured, rollout.x[:-1] + 0.5)


# -- the rung for the least violating plan --------------------------------------------------------


def fast() -> OCP:
    """A cart on a table whose edge is too near for its speed."""
    plain = cart()
    edge = Constraint("edge", plain.model.x[0], upper=0.1)
    return replace(plain, x0=[0.0, 0.0], constraints=(*plain.constraints, edge))


@pytest.mark.parametrize(
    "solver",
    [MultipleShooting(10), MultipleShooting(10, backend="fatrop"), Collocation(5)],
    ids=repr,
)
def test_where_no_plan_meets_a_limit_the_least_violation_is_chosen(solver: Solver) -> None:
    """At 1 m/s, 0.1 m before the edge: the full brake passes it by 0.15 m."""
    mpc = controller(solver, ocp=fast())
    decided = mpc.step([0.0, 1.0], 0.0)
    assert decided.source is InputSource.LEAST_VIOLATING
    assert decided.input[0] == pytest.approx(-LIMIT, abs=1e-3)
    assert "no plan meets the constraints; constraint 'edge' is violated by 0.15" in decided.message
    assert decided.clipped == 0.0
    rollout = controller(solver, ocp=fast()).run(Plant(ocp=fast()), [0.0, 1.0], 2.0)
    assert rollout.violation == pytest.approx(0.15, abs=5e-3)
    assert rollout.sources[-1] is InputSource.OPTIMAL
    assert "no plan that meets the constraints" in rollout.advice
    assert "longer horizon" in repr(rollout)


def test_a_limit_of_the_input_that_moves_is_kept_by_what_acts_at_an_edge() -> None:
    """Between two points a control is held at its mean, which the limit at their edge excludes."""
    plain, t = cart(), ca.SX.sym("t")
    model = replace(plain.model, t=t)
    supply = Constraint("supply", model.u - 0.5 - ca.sin(9 * t), upper=0.0)
    asked = replace(plain, model=model, x0=[-1.0, 0.0], constraints=(*plain.constraints, supply))
    rollout = controller(Collocation(5), ocp=asked).run(Plant(ocp=plain), [-1.0, 0.0], 1.0)
    for k, u in enumerate(rollout.inputs.ravel()):
        assert u <= 0.5 + np.sin(9 * DT * k) + 1e-9
    assert InputSource.BACKUP not in rollout.sources


def test_the_rung_has_the_time_of_its_step_only() -> None:
    """With no time left it is not tried, and with the budget used up by it, it does not act."""
    mpc = controller(ocp=fast(), backup=lambda x, t: [0.0])
    told = mpc.step([0.0, 1.0], 0.0, late=True)
    assert told.source is InputSource.BACKUP
    hasty = controller(ocp=fast(), backup=lambda x, t: [0.0], budget=1e-9)
    decided = hasty.step([0.0, 1.0], 0.0)
    assert decided.source is InputSource.BACKUP
    assert decided.late


def test_where_the_second_program_meets_the_constraints_it_says_so() -> None:
    """Only the solver itself fails: the plan at a price needs none."""
    calls: list[float] = []

    def once(solution: Solution, t0: float) -> Solution:
        calls.append(t0)
        failed = {"status": Status.DIVERGED, "message": "on purpose"}
        return solution.with_(**failed) if len(calls) == 1 else solution

    decided = controller(Altered(MultipleShooting(10), once)).step([0.5, 0.0], 0.0)
    assert decided.source is InputSource.FEASIBLE
    assert "on purpose" in decided.message
    assert "another plan meets the constraints" in decided.message


def test_linear_mpc_has_the_rung_as_well() -> None:
    edge = replace(LINEAR, x0=[0.0, 0.0], state_bounds=Box([-9.0, -9.0], [0.1, 9.0]))
    mpc = controller(LinearMPC(), ocp=edge)
    decided = mpc.step([0.0, 1.0], 0.0)
    assert decided.source is InputSource.LEAST_VIOLATING
    assert decided.input[0] == pytest.approx(-LIMIT, abs=1e-6)


@pytest.mark.parametrize(("cost", "unit"), [(1.0, 1.0), (1e-5, 1e-3), (1e5, 1e3)])
@pytest.mark.parametrize("backend", ["osqp", "daqp"])
def test_the_price_of_linear_mpc_follows_the_units(cost: float, unit: float, backend) -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    f = ca.vertcat(x[0] + DT * x[1], x[1] + DT * unit * u)
    asked = OCP(
        name="edge",
        model=Model(name="cart", x=x, u=u, f=f, dt=DT),
        x0=[0.0, 0.0],
        horizon=15,
        running_cost=cost * ((10 * x[0] ** 2 + x[1] ** 2) / unit**2 + 0.1 * u**2),
        control_bounds=Box(-2.0, 2.0),
        state_bounds=Box([-9 * unit, -9 * unit], [0.1 * unit, 9 * unit]),
    )
    decided = controller(LinearMPC(backend), ocp=asked).step([0.0, unit], 0.0)
    assert decided.source is InputSource.LEAST_VIOLATING, decided.message
    assert decided.input[0] == pytest.approx(-LIMIT, abs=1e-5)


@pytest.mark.parametrize("dt", [1e-3, 1.0])
def test_an_end_is_missed_least_whatever_a_step_lasts(dt: float) -> None:
    """A limit that cannot be met leaves the end, which can, to be met."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    asked = OCP(
        name="steps",
        model=Model(name="steps", x=x, u=u, f=x + u, dt=dt),
        x0=[0.0],
        horizon=10,
        running_cost=u**2,
        control_bounds=Box(-2.0, 2.0),
        constraints=(
            Constraint("away", x, lower=1.0),
            Constraint("end", x, 5.0, 5.0, at="terminal"),
        ),
    )
    decided = MPC(ocp=asked, solver=MultipleShooting(), dt=dt).step([-5.0], 0.0)
    assert decided.source is InputSource.LEAST_VIOLATING
    assert decided.plan is not None
    assert decided.plan.x[-1, 0] == pytest.approx(5.0, abs=1e-3)


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_after_a_push_no_plan_is_followed_past_its_end(backend) -> None:
    """The end cannot be reached in time: what was planned before the push led 5.7 m away."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    asked = OCP(
        name="dock",
        model=Model(name="ship", x=x, u=u, f=ca.vertcat(x[1], u)),
        x0=[0.8, 0.0],
        horizon=1.5,
        running_cost=u**2,
        control_bounds=Box(-3.0, 3.0),
        constraints=(Constraint("end", x, 0.0, 0.0, at="terminal"),),
    )
    mpc, z, furthest = controller(MultipleShooting(15, backend=backend), ocp=asked), [0.8, 0.0], 0.0
    for k in range(40):
        z[1] += 3.0 * (k == 8)
        a = mpc.step(z, k * DT).input[0]
        z = [z[0] + DT * z[1] + DT**2 / 2 * a, z[1] + DT * a]
        furthest = max(furthest, z[0])
    assert furthest < 2.5
    assert abs(z[0]) < 0.1


def test_the_rung_can_be_left_out() -> None:
    mpc = controller(ocp=fast(), least_violating=False, backup=lambda x, t: [0.0])
    assert mpc.step([0.0, 1.0], 0.0).source is InputSource.BACKUP


def test_a_loop_on_good_plans_needs_no_advice() -> None:
    rollout = controller().run(Plant(ocp=cart()), [1.0, 0.0], 1.0)
    assert rollout.advice == ""
    assert "\n" not in repr(rollout)


@pytest.mark.slow
def test_the_rung_is_recorded_replayed_and_saved(tmp_path) -> None:
    mpc = controller(ocp=fast())
    with FlightRecorder(mpc, tmp_path / "flight") as recorder:
        rollout = mpc.run(Plant(ocp=fast()), [0.0, 1.0], 1.5, watch=recorder.watch)
    again = list(replay_all(mpc, tmp_path / "flight", range(15)))
    assert [found.record.source for found in again] == list(rollout.sources)
    assert all(found.is_exact for found in again)
    rollout.save(tmp_path / "rollout.npz")
    assert Rollout.load(tmp_path / "rollout.npz", fast()).sources == rollout.sources
