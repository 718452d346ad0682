"""A model without controls: everything solves it or refuses it by name."""

import math

import casadi as ca
import numpy as np
import pytest

from ocp import (
    MPC,
    OCP,
    Constraint,
    Model,
    Plant,
    Solution,
    Solver,
    Status,
    UnsupportedProblem,
    costates_along,
    evaluate,
    solve,
)
from solvers import (
    AugmentedLagrangian,
    Batch,
    BetweenNodes,
    Collocation,
    IndirectShooting,
    LinearMPC,
    MultipleShooting,
    ReverseShooting,
    Riccati,
    Schuetz,
    StagewiseNewton,
    certify,
    diagnose,
    multistart,
    polish,
)

# v falls as e^-t while x covers the distance 1: v(0) = 1 / (1 - 1/e), and v(1)^2 is the cost.
LEAST = 1.0 / (math.e - 1.0) ** 2
SOLVERS: tuple[Solver, ...] = (
    MultipleShooting(40),
    MultipleShooting(40, backend="fatrop"),
    MultipleShooting(40, backend="native"),
    MultipleShooting(40, compiled=True),
    Collocation(8),
    Collocation(8, points="gauss"),
    IndirectShooting(segments=4, steps=40),
    StagewiseNewton(20),
    Schuetz.sound(),
    AugmentedLagrangian(Schuetz.sound()),
    BetweenNodes(MultipleShooting(40)),
    ReverseShooting(),
    LinearMPC(),
    Riccati(),
    Batch(),
)


def flight(*, free: bool = True) -> OCP:
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    ends = (
        Constraint("from", x, 0.0, 0.0, at="initial"),
        Constraint("to", x, 1.0, 1.0, at="terminal"),
    )
    return OCP(
        name="free flight",
        model=Model(name="body", x=ca.vertcat(x, v), u=ca.SX(0, 1), f=ca.vertcat(v, -v)),
        x0=[0.0, 1.0],
        horizon=1.0,
        terminal_cost=v**2,
        constraints=ends if free else (),
    )


def coasting() -> OCP:
    x = ca.SX.sym("x")
    body = Model(name="body", x=x, u=ca.SX(0, 1), f=0.5 * x, dt=1.0)
    return OCP(name="coasting", model=body, x0=[1.0], horizon=4, running_cost=x**2)


@pytest.mark.many
@pytest.mark.parametrize("solver", SOLVERS, ids=repr)
@pytest.mark.parametrize(
    ("ocp", "cost"),
    [(flight(), LEAST), (flight(free=False), math.exp(-2.0)), (coasting(), 85.0 / 64.0)],
    ids=["free start", "given start", "discrete"],
)
def test_solved_or_refused_by_name(ocp, cost, solver, tmp_path):
    refusal = ""
    try:
        found = solve(ocp, solver)
    except UnsupportedProblem as error:
        found, refusal = None, str(error)
    if found is None:
        assert ocp.name in refusal
        return
    assert found.status.is_success or found.status is Status.SMALL_DECREASE
    assert found.cost == pytest.approx(cost, rel=1e-5)
    assert found.control(0.3).shape == (0,)
    assert found.control([0.1, 0.3]).shape == (2, 0)
    assert evaluate(found).cost == pytest.approx(cost, rel=1e-5)
    assert costates_along(found).costate.shape == found.x.shape
    loaded = Solution.load(found.save(tmp_path / "free"), ocp)
    np.testing.assert_array_equal(loaded.x, found.x)
    assert found.plot().axes


@pytest.mark.slow
def test_what_builds_on_solvers():
    found = solve(flight(), MultipleShooting(40))
    assert polish(found).cost == pytest.approx(LEAST, rel=1e-9)
    assert certify(found).cost == pytest.approx(LEAST, rel=1e-6)
    assert not diagnose(flight()).serious
    starts = multistart(flight(), MultipleShooting(40), starts=2, seed=0)
    assert starts[0].solution.cost == pytest.approx(LEAST, rel=1e-5)


def test_a_loop_keeps_a_row_for_each_step():
    ocp = flight(free=False)
    rollout = MPC(ocp=ocp, solver=MultipleShooting(5), dt=0.1).run(Plant(ocp=ocp), [0.0, 1.0], 0.3)
    assert rollout.inputs.shape == (3, 0)
    assert rollout.measured.shape == (3, 2)
    assert rollout.x[-1, 1] == pytest.approx(math.exp(-0.3))
