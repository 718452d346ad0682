"""Whatever acts is inside every row that limits what is sent."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    InputSource,
    Model,
    Plant,
    PlantInput,
    ProblemError,
    Rate,
)
from ocp.mpc.input_limits import InputLimits, Instant
from solvers import LinearMPC, MultipleShooting, StagewiseNewton

X, U, T = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("t")


def cart(**changes) -> OCP:
    given = {
        "name": "cart",
        "model": Model(
            name="cart",
            x=X,
            u=U,
            t=T,
            f=ca.vertcat(X[0] + 0.1 * X[1], X[1] + 0.1 * U),
            dt=0.1,
        ),
        "x0": [2.0, 0.0],
        "horizon": 10,
        "running_cost": 10 * X[0] ** 2 + X[1] ** 2 + 0.1 * U**2,
        "control_bounds": Box(-2.0, 2.0),
    }
    return OCP(**(given | changes))


# -- soft rows ------------------------------------------------------------------------------------


def test_a_soft_plan_is_followed_and_the_speed_brought_back() -> None:
    limited = cart(x0=[3.0, 0.0], horizon=15, state_bounds=Box([-9, -0.6], [9, 0.6]))
    mpc, x = MPC(ocp=limited, solver=LinearMPC(soft=1e4), dt=0.1), np.array([3.0, -1.2])
    for k in range(12):
        decided = mpc.step(x, 0.1 * k)
        assert decided.source is InputSource.OPTIMAL, decided.message
        x = np.array([x[0] + 0.1 * x[1], x[1] + 0.1 * decided.input[0]])
    assert x[1] == pytest.approx(-0.6, abs=1e-3)


def test_soft_rows_leave_the_actuator_its_own_bound() -> None:
    limited = cart(state_bounds=Box([-9, -0.6], [9, 0.6]))
    slow = replace(limited, rates=(Rate(U, -0.5, 0.5, weight=0.01),), last_input=[0.0])
    plan = LinearMPC(soft=100.0).build(slow).run(x0=[2.0, -3.0])
    assert plan.status.is_success
    assert np.abs(plan.u).max() <= 2.0 + 1e-7
    assert np.abs(np.diff(plan.u[:, 0], prepend=0.0)).max() <= 0.5 + 1e-7
    assert plan.x[:, 1].min() < -0.6


# -- limits ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("backup", ["default", "hold"])
def test_a_slow_actuator_stays_within_its_bounds(backup) -> None:
    """A push that no plan can mend in one step: the increment was repeated, up to six bounds."""
    limited = cart(control_bounds=Box(-1.0, 1.0), state_bounds=Box([-9, -0.5], [9, 0.5]))
    slow = replace(limited, rates=(Rate(U, -0.2, 0.2, weight=0.1),), last_input=[0.0])
    mpc = MPC(ocp=slow, solver=LinearMPC(), dt=0.1, backup=backup)
    x, before, sources = np.zeros(2), 0.0, set()
    for k in range(30):
        x[1] += 1.2 * (k == 5)
        decided = mpc.step(x, 0.1 * k)
        force = decided.input[0]
        sources.add(decided.source)
        x = np.array([x[0] + 0.1 * x[1], x[1] + 0.1 * force])
        assert abs(force) <= 1.0 + 1e-9
        assert abs(force - before) <= 0.2 + 1e-9
        before = force
    assert sources - {InputSource.OPTIMAL}


def test_a_bound_that_varies_with_time_holds_for_the_backup_too() -> None:
    supply = Constraint("supply", U - 0.5 - 0.4 * ca.cos(T), upper=0.0)
    asked = cart(constraints=(supply,))
    mpc = MPC(ocp=asked, solver=LinearMPC(), dt=0.1, backup=lambda x, t: [2.0])
    for k in range(20):
        decided = mpc.step([np.nan, np.nan], 0.1 * k)
        assert decided.source is InputSource.BACKUP
        assert decided.input[0] == pytest.approx(0.5 + 0.4 * np.cos(0.1 * k), abs=1e-9)


def test_a_limit_of_the_input_stays_one_beside_a_rate() -> None:
    supply = Constraint("supply", ca.vertcat(U, X[1]), [-np.inf, -9.0], [0.5, 9.0])
    slow = cart(constraints=(supply,), rates=(Rate(U, -0.3, 0.3),), last_input=[0.0])
    for solver in (LinearMPC(soft=1.0), LinearMPC()):
        mpc, x = MPC(ocp=slow, solver=solver, dt=0.1), np.array([-2.0, 0.0])
        for k in range(8):
            force = mpc.step(x, 0.1 * k).input[0]
            assert force <= 0.5 + 1e-9
            x = np.array([x[0] + 0.1 * x[1], x[1] + 0.1 * force])


def test_from_the_middle_of_a_ring_an_input_is_moved_onto_it() -> None:
    """There the slope of the row vanishes."""
    plain = disc()
    limits = InputLimits(
        replace(plain, constraints=(Constraint("ring", ca.sumsqr(plain.model.u), 0.5, 1.0),)),
        PlantInput(),
        0.1,
    )
    at = Instant(np.zeros(2), 0.0, np.empty(0))
    found = limits.nearest(np.zeros(2), at)
    assert np.linalg.norm(found) == pytest.approx(np.sqrt(0.5), abs=1e-4)
    assert limits.exceeded(found, at) == ""


def test_limits_that_exclude_each_other_are_named() -> None:
    beyond = cart(constraints=(Constraint("supply", U, lower=3.0),))
    mpc = MPC(ocp=beyond, solver=LinearMPC(), dt=0.1, backup=lambda x, t: [0.0])
    decided = mpc.step([1.0, 0.0], 0.0)
    assert decided.input[0] == 2.0
    assert "constraint 'supply' is violated by 1" in decided.message


def disc() -> OCP:
    u = ca.SX.sym("u", 2)
    plane = Model(name="plane", x=X, u=u, f=u)
    return OCP(
        name="disc",
        model=plane,
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=ca.sumsqr(X) + ca.sumsqr(u),
        control_bounds=Box(-1.0, 1.0),
        constraints=(Constraint("friction", ca.sumsqr(u), upper=1.0),),
    )


@pytest.mark.slow
@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=2))
def test_the_nearest_point_of_a_disc(wanted: list[float]) -> None:
    limits = InputLimits(disc(), PlantInput(), 0.1)
    found = limits.nearest(np.array(wanted), Instant(np.zeros(2), 0.0, np.empty(0)))
    assert np.linalg.norm(found) <= 1.0 + 1e-8
    if np.linalg.norm(wanted) > 1.0 and max(map(abs, wanted)) <= 1.0:
        np.testing.assert_allclose(found, np.array(wanted) / np.linalg.norm(wanted), atol=1e-6)
    if np.linalg.norm(wanted) <= 1.0:
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.slow
@given(
    u=st.floats(-10, 10),
    before=st.floats(-3, 3),
    low=st.floats(-2, 0),
    high=st.floats(0, 2),
)
def test_rows_of_one_control_are_an_interval(u: float, before: float, low: float, high: float):
    """Where the actuator is outside already, its own bounds win."""
    slow = cart(control_bounds=Box(low, high), rates=(Rate(U, -0.5, 0.5),), last_input=[low])
    at = Instant(np.array([0.0, 0.0]), 0.0, np.array([before]))
    found = float(InputLimits(slow, PlantInput(), 0.1).nearest(np.array([u]), at)[0])
    assert low <= found <= high
    if low - 0.5 <= before <= high + 0.5:
        assert abs(found - before) <= 0.5 + 1e-9
    else:
        assert found == pytest.approx(high if before > 0 else low)


def test_only_a_path_constraint_limits_an_input() -> None:
    with pytest.raises(ProblemError, match="path"):
        Constraint("end", X, 0.0, 0.0, at="terminal", limits_input=True)
    with pytest.raises(ProblemError, match="limits_input"):
        Constraint("end", X, limits_input="yes")  # pyright: ignore[reportArgumentType]


# -- in the sizes of the rows ---------------------------------------------------------------------


@pytest.mark.many
@pytest.mark.parametrize("unit", [1e-7, 1.0, 1e7])
@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_plans_are_judged_in_sizes_of_the_rows(unit: float, backend) -> None:
    """A violation of 1e-5 Pa in a million made the loop throw solved plans away."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    asked = OCP(
        name="axis",
        model=Model(name="axis", x=x, u=u, f=unit * u - x),
        x0=[0.9 * unit],
        horizon=1.0,
        running_cost=(x / unit - 2) ** 2 + 0.01 * u**2,
        control_bounds=Box(-5.0, 5.0),
        state_bounds=Box(-unit, unit),
    )
    mpc = MPC(ocp=asked, solver=MultipleShooting(10, backend=backend), dt=0.1)
    rollout = mpc.run(Plant(ocp=asked), [0.9 * unit], 2.0)
    assert set(rollout.sources) == {InputSource.OPTIMAL}, rollout.messages


# -- suggested laws that see nothing --------------------------------------------------------------


def heated(cost: ca.SX) -> OCP:
    warmth, heat = ca.SX.sym("warmth"), ca.SX.sym("heat")
    room = Model(name="room", x=warmth, u=heat, f=warmth + 0.1 * (5 - warmth) + heat, dt=1.0)
    return OCP(
        name="room",
        model=room,
        x0=[20.0],
        horizon=8,
        running_cost=ca.substitute(cost, U, heat) + 1e-4 * heat**2,
        control_bounds=Box(0.0, 3.0),
        state_bounds=Box(18.0, 24.0),
    )


def test_a_price_suggests_no_regulator() -> None:
    law = MPC(ocp=heated(U), solver=LinearMPC(), dt=1.0).backup_law
    assert law.name == "hold"
    assert "sees no warmth" in law.why


def test_a_cost_that_sees_the_state_does() -> None:
    priced = heated(U)
    seen = replace(priced, running_cost=priced.running_cost + (priced.model.x - 20) ** 2)
    law = MPC(ocp=seen, solver=LinearMPC(), dt=1.0).backup_law
    assert law.name == "saturated regulator"


@pytest.mark.parametrize(
    "solver", [LinearMPC(), MultipleShooting(10), MultipleShooting(10, backend="fatrop")], ids=repr
)
def test_a_price_is_followed_in_the_loop(solver) -> None:
    rollout = MPC(ocp=heated(U), solver=solver, dt=1.0).run(Plant(ocp=heated(U)), [20.0], 10.0)
    assert set(rollout.sources) == {InputSource.OPTIMAL}, rollout.messages
    assert rollout.violation <= 1e-6


def test_a_solver_without_rows_is_asked_the_same_way() -> None:
    plain = cart()
    assert StagewiseNewton(10).imposed(plain).rows is plain.rows
    soft = LinearMPC(soft=1.0).imposed(cart(state_bounds=Box(-9.0, 9.0))).rows
    assert {row.kind for row in soft.states.rows} == {"soft"}
    assert {row.kind for row in soft.controls.rows} == {"input"}
