"""Whatever acts changes no faster than a ``Rate`` allows, from what acted last on."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import pytest

from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    FlightRecorder,
    InputSource,
    Model,
    Parameter,
    Plant,
    PlantInput,
    Program,
    Rate,
    Solver,
    UnsupportedProblem,
    replay_all,
)
from solvers import Collocation, LinearMPC, MultipleShooting

P, V, F, W = (ca.SX.sym(name) for name in ("position", "velocity", "force", "wanted"))
CART = Model(name="cart", x=ca.vertcat(P, V), u=F, f=ca.vertcat(P + 0.1 * V, V + 0.1 * F), dt=0.1)
MASS = Model(name="mass", x=ca.vertcat(P, V), u=F, f=ca.vertcat(V, F))
RATE = 0.3


def cart(**changes: Any) -> OCP:
    given: dict[str, Any] = {
        "name": "cart",
        "model": CART,
        "x0": [1.0, 0.0],
        "horizon": 20,
        "running_cost": 10 * (P - W) ** 2 + V**2 + 0.1 * F**2,
        "control_bounds": Box(-2, 2),
        "parameters": (Parameter("wanted", W, 0.0),),
        "rates": (Rate(F, -RATE, RATE, weight=0.01),),
        "last_input": [0.0],
    }
    return OCP(**(given | changes))


def mass(**changes: Any) -> OCP:
    per_second = (Rate(F, -10 * RATE, 10 * RATE, weight=1e-4),)
    return cart(**({"model": MASS, "horizon": 2.0, "rates": per_second} | changes))


LOOPS = [
    (cart(), LinearMPC()),
    (cart(), MultipleShooting()),
    (mass(), MultipleShooting(20)),
    (mass(), Collocation(7, degree=3)),
]


def changes(inputs: np.ndarray) -> np.ndarray:
    return np.diff(inputs[:, 0], prepend=0.0)


@pytest.mark.parametrize(
    ("ocp", "solver"), LOOPS, ids=lambda part: getattr(part, "name", repr(part))
)
def test_plans_are_followed_at_the_full_rate(ocp, solver):
    mpc = MPC(ocp=ocp, solver=solver, dt=0.1)
    rollout = mpc.run(Plant(ocp=ocp), x0=[1, 0], duration=4.0)
    assert set(rollout.sources) <= {InputSource.OPTIMAL, InputSource.FEASIBLE}, rollout.messages
    assert np.abs(changes(rollout.inputs)).max() == pytest.approx(RATE, abs=1e-6)
    assert rollout.violation < 1e-6
    assert np.abs(rollout.x[-1]).max() < 0.1


@dataclass(frozen=True)
class Failing(Solver):
    """Fails at some steps."""

    inner: Solver
    when: set[int] = field(default_factory=set)

    def build(self, ocp: OCP) -> Program:
        return FailingProgram(self.inner.build(ocp), self.when)


@dataclass(eq=False)
class FailingProgram(Program):
    inner: Program
    when: set[int]

    def run(self, *, t0: float = 0.0, **given: Any):
        if round(t0 / 0.1) in self.when:
            raise ArithmeticError("on schedule")
        return self.inner.run(t0=t0, **given)


@pytest.mark.parametrize("backup", ["default", "hold", "wild"])
@pytest.mark.parametrize("ocp", [cart(), mass()], ids=lambda ocp: ocp.name)
def test_every_rung_stays_within_the_rate(ocp, backup):
    """A law that jumps from bound to bound, measurements that are missing, a solver that fails."""
    law = (lambda x, t: [2.0 * (-1) ** round(t / 0.1)]) if backup == "wild" else backup
    inner = LinearMPC() if ocp.model.is_discrete else MultipleShooting(20)
    solver = Failing(inner, {0, 1, 2, *range(8, 14), 20})
    mpc, rng = MPC(ocp=ocp, solver=solver, dt=0.1, backup=law), np.random.default_rng(0)
    x, before, seen = np.array([1.0, 0.0]), 0.0, set()
    for k in range(24):
        told = [np.nan, np.nan] if k in (5, 6, 15) else x + 0.3 * rng.normal(size=2)
        decision = mpc.step(told, 0.1 * k)
        force = decision.input[0]
        assert abs(force - before) <= RATE + 1e-8, decision.message
        assert abs(force) <= 2.0
        x, before = x + 0.1 * np.array([x[1], force]), force
        seen.add(decision.source)
    assert len(seen) > 1


def test_the_input_before_may_be_told():
    """A driver that knows where the actuator is says so with the parameters."""
    mpc = MPC(ocp=cart(), solver=LinearMPC(), dt=0.1)
    mpc.step([1, 0], 0.0)
    told = mpc.step([1, 0], 0.1, parameters={"last_input": [1.0]})
    assert told.input[0] == pytest.approx(1.0 - RATE, abs=1e-6)
    assert mpc.step([1, 0], 0.2).input[0] == pytest.approx(1.0 - 2 * RATE, abs=1e-6)


def test_parameters_that_are_unknown_leave_the_last_input_known():
    def wanted(t: float) -> dict[str, float]:
        if 0.15 < t < 0.45:
            raise ConnectionError("the line is down")
        return {"wanted": 0.0}

    mpc, before = MPC(ocp=cart(), solver=LinearMPC(), dt=0.1, parameters=wanted), 0.0
    for k in range(7):
        decision = mpc.step([1.0, 0.0], 0.1 * k)
        assert abs(decision.input[0] - before) <= RATE + 1e-8
        before = decision.input[0]


def test_a_rate_beside_a_delay_counts_from_what_was_sent():
    mpc = MPC(ocp=cart(), solver=LinearMPC(), dt=0.1, delay=0.2)
    rollout = mpc.run(Plant(ocp=cart()), x0=[1, 0], duration=4.0)
    assert np.abs(changes(rollout.inputs)).max() <= RATE + 1e-8
    assert np.abs(rollout.x[-1]).max() < 0.1


def test_a_recorded_loop_is_replayed_to_the_last_bit(tmp_path):
    mpc, path = MPC(ocp=cart(), solver=LinearMPC(), dt=0.1), tmp_path / "flight"
    with FlightRecorder(mpc, path) as recorder:
        mpc.run(Plant(ocp=cart()), x0=[1, 0], duration=1.0, watch=recorder.watch)
    assert all(again.is_exact for again in replay_all(mpc, path, range(10)))


def test_a_plant_with_a_rate_judges_what_it_gets():
    """Too fast by 0.2 a step, and the price of that."""
    plain = cart(running_cost=0.0, rates=(Rate(F, -0.1, 0.1, weight=2.0),))
    plant = Plant(ocp=plain, parameters=lambda t: {"wanted": 0.0}).started([0, 0])
    cost, excess, worst = plant.advance(np.array([0.3]), 0.1)
    assert (cost, excess) == (pytest.approx(2 * 0.09), pytest.approx(0.2))
    assert "rate of force" in worst
    assert plant.advance(np.array([0.3]), 0.1)[:2] == (0.0, 0.0)
    moving = Plant(ocp=mass(running_cost=0.0)).started([0, 0])
    cost, excess, _ = moving.advance(np.array([0.5]), 0.1)
    assert (cost, excess) == (pytest.approx(1e-4 * 25 * 0.1), pytest.approx(2.0))


def test_limits_that_depend_on_the_time_and_the_rate_together():
    t = CART.t
    supply = Constraint("supply", F - 1.0 + 0.2 * t, upper=0.0)
    mpc, before = MPC(ocp=cart(constraints=(supply,)), solver=LinearMPC(), dt=0.1), 0.0
    for k in range(30):
        decision = mpc.step([-5.0, 0.0], 0.1 * k)
        assert decision.input[0] <= 1.0 - 0.02 * k + 1e-8
        assert abs(decision.input[0] - before) <= RATE + 1e-8
        before = decision.input[0]


def test_what_has_no_meaning_in_a_loop_is_refused():
    with pytest.raises(UnsupportedProblem, match="last input is free"):
        MPC(ocp=cart(last_input=None), solver=LinearMPC(), dt=0.1)
    with pytest.raises(UnsupportedProblem, match="rates are those of controls"):
        MPC(ocp=mass(), solver=MultipleShooting(5), dt=0.1, applied=PlantInput("rate"))
