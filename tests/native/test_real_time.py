"""Real-time iterations: a plan for the expected state, corrected by the measured one."""

from collections import Counter
from copy import deepcopy
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from models import cart_pole_upright
from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    Decision,
    FlightRecorder,
    Guess,
    InputSource,
    Model,
    Parameter,
    Peak,
    Plant,
    ProblemError,
    Rate,
    Soft,
    Solution,
    Status,
    UnsupportedProblem,
    evaluate,
    replay,
)
from ocp.internal import ShiftedPlan
from solvers import MultipleShooting, StagewiseNewton
from solvers.direct.multiple_shooting import MultipleShootingProgram

N, DT = 20, 0.05
NATIVE = MultipleShooting(N, backend="native")
X, U = ca.SX.sym("x", 2), ca.SX.sym("u")


def built(ocp: OCP) -> MultipleShootingProgram:
    program = NATIVE.for_control_loop(compiled=False, time_limit=10.0).build(ocp)
    assert isinstance(program, MultipleShootingProgram)
    return program


def pendulum(**changes) -> OCP:
    """A pendulum that is held up, within a curved row that is active and bends the optimum."""
    given = {
        "name": "held up",
        "model": Model(name="pendulum", x=X, u=U, f=ca.vertcat(X[1], U + ca.sin(X[0]))),
        "x0": [0.6, 0.2],
        "horizon": 1.0,
        "running_cost": 4.0 * X[0] ** 2 + 0.1 * X[1] ** 2 + 0.05 * U**2,
        "terminal_cost": 5.0 * X[0] ** 2 + X[1] ** 2,
        "control_bounds": Box(-6.0, 6.0),
        "constraints": (Constraint("effort", U**2 + X[1] ** 2, upper=4.0),),
    }
    return OCP(**(given | changes))


def linear() -> OCP:
    """A mass with a quadratic cost, a bound of the control and one of the speed."""
    return pendulum(
        name="linear",
        model=Model(name="mass", x=X, u=U, f=ca.vertcat(X[1], U - 0.3 * X[1])),
        constraints=(Constraint("brake", U + X[1], lower=-1.4),),
        control_bounds=Box(-1.5, 1.5),
        state_bounds=Box([-4.0, -0.45], [4.0, 4.0]),
    )


@pytest.fixture(scope="module")
def program() -> MultipleShootingProgram:
    return built(pendulum())


def corrected(program, base: Solution, x0: np.ndarray) -> Solution:
    """Return the correction for x0 of a plan for the start of the problem."""
    assert program.prepare_feedback(x0=base.x[0], t0=base.t[0], guess=base)
    found = program.feedback(x0=x0, t0=base.t[0])
    assert found is not None
    assert found.status is Status.ITERATION_LIMIT
    assert "real-time iteration" in found.message
    np.testing.assert_array_equal(found.x[0], x0)
    return found


def test_it_is_the_converged_answer_to_second_order(program) -> None:
    base = program.run().or_raise()
    assert np.isclose(base.u[:, 0] ** 2 + base.x[:-1, 1] ** 2, 4.0, atol=1e-6).any()
    direction, sizes = np.array([1.0, -0.7]), 0.04 * 0.5 ** np.arange(4)
    off, moved = [], []
    for size in sizes:
        x0 = base.x[0] + size * direction
        found = corrected(program, base, x0)
        true = program.run(x0=x0, guess=base).or_raise()
        off.append([np.abs(found.u - true.u).max(), np.abs(found.costate - true.costate).max()])
        moved.append(np.abs(true.u - base.u).max())
    order = np.log2(np.array(off)[:-1] / np.array(off)[1:])
    np.testing.assert_allclose(order[-1], 2.0, atol=0.2)
    assert off[-1][0] < 0.05 * moved[-1]


def test_of_a_linear_quadratic_problem_it_is_the_answer() -> None:
    program = built(linear())
    base = program.run().or_raise()
    for x0 in ([0.62, 0.15], [1.2, -0.3], [-0.9, 0.4]):  # with other bounds active
        found = corrected(program, base, np.array(x0))
        true = program.run(x0=x0, guess=base).or_raise()
        np.testing.assert_allclose(found.u, true.u, atol=1e-6)
        np.testing.assert_allclose(found.x, true.x, atol=1e-6)
        np.testing.assert_allclose(found.costate, true.costate, atol=1e-5)
        assert found.cost == pytest.approx(true.cost, rel=1e-7)


def test_it_is_there_once_for_its_time_and_until_the_next_run(program) -> None:
    base = program.run().or_raise()
    x0 = base.x[0]
    assert program.feedback(x0=x0) is None
    assert program.prepare_feedback(x0=x0, guess=base)
    assert program.feedback(x0=x0, t0=0.01) is None
    assert program.feedback(x0=x0) is None
    assert program.prepare_feedback(x0=x0, guess=base)
    program.run(guess=base)
    assert program.feedback(x0=x0) is None
    assert not program.prepare_feedback(x0=x0)  # from no plan nothing is prepared
    with pytest.raises(ProblemError, match="x0"):
        program.feedback(x0=[np.nan, 0.0])


def test_a_frozen_program_without_a_solution_has_no_answer() -> None:
    program = built(linear())
    base = program.run().or_raise()
    assert program.prepare_feedback(x0=base.x[0], guess=base)
    assert program.feedback(x0=[0.6, -3.0]) is None  # the speed cannot be met


def test_no_saddle_is_frozen() -> None:
    """Moving sideways by either y lowers the cost, and where y = 0 by symmetry nothing moves."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 2)
    program = built(
        OCP(
            name="mirrored",
            model=Model(name="mirrored", x=x, u=u, f=u),
            x0=[0.0, 0.0],
            horizon=1.0,
            running_cost=ca.sumsqr(u) - 8.0 * x[1] ** 2 + 4.0 * x[1] ** 4,
            terminal_cost=50.0 * (x[0] - 1.0) ** 2,
        )
    )
    along = np.linspace(0.0, 1.0, N + 1)[:, None] * [50.0 / 51.0, 0.0]
    pull = np.tile([-2.0 * 50.0 / 51.0, 0.0], (N + 1, 1))
    saddle = Guess(x=along, u=-0.5 * pull, costate=pull)
    start = np.zeros(2)
    assert program.prepare_feedback(x0=start, guess=saddle)
    found = program.feedback(x0=start)
    assert found is not None
    assert np.abs(found.u[:, 1]).max() > 0.1
    assert found.cost < 0.9 * 50.0 / 51.0


def test_nothing_is_frozen_for_other_parameters_than_it_is_asked_for() -> None:
    pull = ca.SX.sym("p")
    program = built(
        pendulum(
            model=Model(name="pulled", x=X, u=U, f=ca.vertcat(X[1], U + pull * ca.sin(X[0]))),
            parameters=(Parameter("p", pull, 1.0),),
            constraints=(),
        )
    )
    base = program.run().or_raise()
    x0 = base.x[0]
    for prepared, asked, is_there in ((1.0, 2.0, False), (2.0, 2.0, True), (2.0, 1.0, False)):
        assert program.prepare_feedback(x0=x0, guess=base, parameters={"p": prepared})
        assert (program.feedback(x0=x0, parameters={"p": asked}) is not None) == is_there


# -- in the loop ------------------------------------------------------------------------------


def controller(ocp: OCP, **options) -> MPC:
    return MPC(ocp=ocp, solver=NATIVE, dt=DT, compiled=False, **options)


def test_a_loop_corrects_prepared_plans_and_acts_as_one_that_solves() -> None:
    ocp, start = cart_pole_upright(), np.array([0.0, np.pi - 0.2, 0.0, 0.0])
    plant = Plant(ocp=ocp, measurement_noise=np.array([1e-3, 1e-3, 1e-2, 1e-2]))
    solving, correcting = (
        controller(ocp, real_time=on).run(plant, start, 2.0, seed=3) for on in (False, True)
    )
    counts = Counter(correcting.sources)
    assert counts[InputSource.OPTIMAL] == 1  # the first step, for which nothing was prepared
    assert counts[InputSource.REAL_TIME] == len(correcting.sources) - 1
    assert all("real-time iteration" in said for said in correcting.messages[1:])
    assert correcting.costs.sum() == pytest.approx(solving.costs.sum(), rel=1e-2)


def test_a_push_that_the_correction_does_not_survive_is_solved_for() -> None:
    mpc = controller(pendulum(), real_time=True)
    decision = mpc.step([0.6, 0.2], 0.0)
    assert decision.source is InputSource.OPTIMAL
    assert mpc.prepare_next()
    pushed = mpc.step([0.9, 1.2], DT)  # the curved row is violated by what is linear
    assert pushed.source is InputSource.OPTIMAL
    assert pushed.plan is not None
    assert mpc.prepare_next()
    x = pushed.plan.state(2 * DT)
    assert mpc.step(x, 2.3 * DT).source is InputSource.OPTIMAL  # not when it was expected


def moved(mpc: MPC, by: list[float]) -> Decision:
    """Decide from a state that is that far from the one a prepared plan is for."""
    plan = mpc.step([0.6, 0.2], 0.0).plan
    assert plan is not None
    assert mpc.prepare_next()
    return mpc.step(plan.state(DT) + by, DT)


@pytest.fixture(scope="module")
def free() -> MPC:
    """A controller of a pendulum without rows that a roll-out could violate."""
    return controller(pendulum(constraints=()), real_time=True)


def test_where_the_model_leaves_the_states_of_a_correction_a_solve_decides(free) -> None:
    free.reset()
    assert moved(free, [0.01, 0.02]).source is InputSource.REAL_TIME
    free.reset()
    far = moved(free, [2.4, 0.0])
    assert far.source is InputSource.OPTIMAL
    assert far.plan is not None
    assert far.plan.cost == pytest.approx(evaluate(far.plan).cost, rel=1e-3)


def test_a_correction_says_the_residual_of_the_problem_itself(free) -> None:
    residuals = []
    for size in (0.08, 0.04, 0.02):  # so far that no other bound is active
        free.reset()
        decision = moved(free, [-size, size])
        assert decision.source is InputSource.REAL_TIME
        assert decision.plan is not None
        assert decision.plan.cost == pytest.approx(evaluate(decision.plan).cost, rel=1e-3)
        residuals.append(decision.residual)
    order = np.log2(np.array(residuals[:-1]) / residuals[1:])
    np.testing.assert_allclose(order, 2.0, atol=0.3)


def test_a_cost_that_is_not_the_quadratic_one_is_no_answer() -> None:
    ocp = linear()
    quartic = pendulum(
        name="quartic", model=ocp.model, constraints=(), running_cost=X[0] ** 4 + 0.05 * U**2
    )
    program = built(quartic)
    base = program.run().or_raise()
    for x0, is_near in (([0.61, 0.2], True), ([2.6, 0.2], False)):
        assert program.prepare_feedback(x0=base.x[0], guess=base)
        assert (program.feedback(x0=x0) is not None) == is_near


def test_without_preparation_every_step_solves() -> None:
    mpc = controller(pendulum(), real_time=True)
    assert not mpc.prepare_next()  # there is no step yet
    for k in range(3):
        assert mpc.step([0.6, 0.2], k * DT).source is InputSource.OPTIMAL
    plain = controller(pendulum())
    plain.step([0.6, 0.2], 0.0)
    assert not plain.prepare_next()


def test_delays_are_part_of_what_is_expected() -> None:
    ocp = cart_pole_upright()
    start = np.array([0.0, np.pi - 0.1, 0.0, 0.0])
    rollout = controller(ocp, real_time=True, delay=2 * DT).run(Plant(ocp=ocp), start, 1.0)
    assert set(rollout.sources[1:]) == {InputSource.REAL_TIME}


def test_a_delay_that_is_not_compensated_is_no_part_of_what_is_expected() -> None:
    ocp, start = cart_pole_upright(), np.array([0.0, np.pi - 0.1, 0.0, 0.0])
    solving, correcting = (
        controller(ocp, real_time=on, delay=DT, compensate=False).run(Plant(ocp=ocp), start, 1.0)
        for on in (False, True)
    )
    assert set(correcting.sources[1:]) == {InputSource.REAL_TIME}
    np.testing.assert_allclose(correcting.inputs, solving.inputs, atol=1e-4)


def test_a_reference_that_changes_after_the_preparation_is_solved_for() -> None:
    aim = ca.SX.sym("aim")
    ocp = pendulum(
        running_cost=4.0 * (X[0] - aim) ** 2 + 0.1 * X[1] ** 2 + 0.05 * U**2,
        parameters=(Parameter("aim", aim, 0.0),),
        constraints=(),
    )
    aims = {"aim": 0.0}
    mpc = controller(ocp, real_time=True, parameters=lambda t: aims)
    plan = mpc.step([0.6, 0.2], 0.0).plan
    for k, (before, after, source) in enumerate(
        (
            (0.0, 0.0, InputSource.REAL_TIME),
            (0.0, 0.5, InputSource.OPTIMAL),
            (0.5, 0.5, InputSource.REAL_TIME),
        ),
        start=1,
    ):
        aims["aim"] = before
        assert mpc.prepare_next()
        aims["aim"] = after
        assert plan is not None
        decision = mpc.step(plan.state(k * DT), k * DT)
        assert decision.source is source
        plan = decision.plan


@pytest.mark.parametrize("compensate", [True, False])
def test_a_missing_measurement_is_bridged(compensate: bool) -> None:
    ocp = pendulum(constraints=())
    mpc = controller(ocp, real_time=True, delay=DT, compensate=compensate)
    mpc.reset([0.0])
    mpc.step([0.6, 0.2], 0.0)
    assert mpc.prepare_next()
    assert mpc.step([np.nan, 0.2], DT).source is InputSource.SHIFTED
    assert mpc.prepare_next()
    assert mpc.state.seen is not None
    x, acting = np.array([0.6, 0.2]), mpc.state.seen.acting
    for k in range(2):
        x = mpc._ladder._check.next_state(x, acting[k], k * DT, np.empty(0))
    assert mpc.step(x, 2 * DT).source is InputSource.REAL_TIME


@pytest.mark.slow
def test_rates_reach_it_through_the_normal_form() -> None:
    ocp = pendulum(rates=(Rate(U, -20.0, 20.0),), last_input=[0.0], constraints=())
    mpc = controller(ocp, real_time=True)
    x = np.array([0.6, 0.2])
    first = mpc.step(x, 0.0)
    assert mpc.prepare_next()
    assert first.plan is not None
    second = mpc.step(first.plan.x[1] + 1e-4, DT)
    assert second.source is InputSource.REAL_TIME
    assert abs(second.input - first.input) <= 20.0 * DT + 1e-9


def test_a_recorded_correction_replays_to_the_last_bit(tmp_path: Path) -> None:
    mpc = controller(pendulum(), real_time=True)
    plant = Plant(ocp=mpc.ocp, measurement_noise=np.array([1e-4, 1e-3]))
    with FlightRecorder(mpc, tmp_path / "flight") as recorder:
        rollout = mpc.run(plant, [0.6, 0.2], 6 * DT, watch=recorder.watch)
    assert rollout.sources[3] is InputSource.REAL_TIME
    again = replay(controller(pendulum(), real_time=True), recorder.path, 3)
    assert again.is_exact


def test_a_copy_has_nothing_prepared() -> None:
    mpc = controller(pendulum(), real_time=True)
    plan = mpc.step([0.6, 0.2], 0.0).plan
    assert plan is not None
    assert mpc.prepare_next()
    copy, x = deepcopy(mpc), plan.state(DT)
    assert copy.step(x, DT).source is InputSource.OPTIMAL
    assert mpc.step(x, DT).source is InputSource.REAL_TIME


@pytest.mark.parametrize(
    "solver",
    [MultipleShooting(N), MultipleShooting(N, backend="fatrop"), StagewiseNewton(N)],
    ids=["ipopt", "fatrop", "newton"],
)
def test_a_solver_that_cannot_is_refused_by_name(solver) -> None:
    ocp = pendulum(constraints=(), control_bounds=Box())
    with pytest.raises(UnsupportedProblem, match=r"held up: .*prepares no real-time iterations"):
        MPC(ocp=ocp, solver=solver, dt=DT, compiled=False, real_time=True)


def test_a_term_that_needs_a_free_constant_is_refused_by_its_name() -> None:
    peaks = pendulum(peaks=(Peak("speed", X[1], weight=1.0),), constraints=())
    late = Constraint("late", X[0] + X[1], upper=0.0, at="terminal", soft=Soft(linear=3.0))
    for ocp, name in ((peaks, "peak of speed"), (pendulum(constraints=(late,)), "excess of late")):
        with pytest.raises(UnsupportedProblem, match=rf"held up: .*does not give '{name}'") as said:
            controller(ocp, real_time=True)
        assert "backend='native')" not in str(said.value).split("prepares no", 1)[1]


def test_the_option_is_a_flag() -> None:
    with pytest.raises(ProblemError, match="real_time"):
        controller(pendulum(), real_time="yes")


def test_a_plan_for_an_earlier_instant_is_no_answer(program) -> None:
    base = program.run().or_raise()
    assert program.prepare_feedback(x0=base.x[1], t0=DT, guess=ShiftedPlan(base, DT))
    later = program.feedback(x0=base.x[1], t0=DT)
    assert later is not None
    assert later.t[0] == pytest.approx(DT)
    # What is kept unshifted drifts: its time says that it is another horizon's.
    assert program.prepare_feedback(x0=base.x[0], guess=base)
    assert program.feedback(x0=base.x[1], t0=DT) is None
