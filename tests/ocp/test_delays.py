"""Controls that act later: a chain by hand, a roll-out by hand, bad input."""

import pickle
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from ocp import (
    MPC,
    OCP,
    Box,
    Delay,
    Guess,
    Model,
    Plant,
    ProblemError,
    Rate,
    Solution,
    Unknown,
    UnsupportedProblem,
    evaluate,
    linear_quadratic,
    solve,
)
from solvers import LinearMPC, MultipleShooting, Riccati, StagewiseNewton, certify, diagnose

P, V, F, G = (ca.SX.sym(name) for name in ("position", "velocity", "force", "gust"))
CART = Model(
    name="cart",
    x=ca.vertcat(P, V),
    u=ca.vertcat(F, G),
    f=ca.vertcat(P + 0.1 * V, V + 0.1 * F + 0.05 * G),
    dt=0.1,
)
HISTORY = [0.5, -0.2, 0.3]


def cart(**changes: Any) -> OCP:
    given: dict[str, Any] = {
        "name": "cart",
        "model": CART,
        "x0": [1.0, 0.0],
        "horizon": 15,
        "running_cost": 10 * P**2 + V**2 + 0.1 * F**2 + G**2,
        "terminal_cost": 20 * P**2,
        "delays": (Delay(F, 3, HISTORY),),
    }
    return OCP(**(given | changes))


def rolled(found: Solution, history: list[float]) -> tuple[np.ndarray, float]:
    """States and cost of what was sent, step by step."""
    x, cost, rows = np.array([1.0, 0.0]), 0.0, []
    acting = np.append(history, found.u[:, 0])
    for (f, g), a in zip(found.u, acting, strict=False):
        rows.append(x)
        cost += 10 * x[0] ** 2 + x[1] ** 2 + 0.1 * f**2 + g**2
        x = np.array([x[0] + 0.1 * x[1], x[1] + 0.1 * a + 0.05 * g])
    return np.array([*rows, x]), cost + 20 * x[0] ** 2


SOLVERS = [MultipleShooting(), LinearMPC(), StagewiseNewton(), Riccati()]


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: type(solver).__name__)
def test_it_is_a_chain_of_states(solver):
    v = ca.SX.sym("v", 3)
    by_hand = cart(
        model=Model(
            name="chain",
            x=ca.vertcat(P, V, v),
            u=CART.u,
            f=ca.vertcat(P + 0.1 * V, V + 0.1 * v[0] + 0.05 * G, v[1], v[2], F),
            dt=0.1,
        ),
        x0=[1, 0, *HISTORY],
        delays=(),
    )
    hand, found = solve(by_hand, solver).or_raise(), solve(cart(), solver).or_raise()
    assert found.cost == pytest.approx(hand.cost, rel=1e-12)
    np.testing.assert_allclose(found.u, hand.u, atol=1e-7)
    np.testing.assert_allclose(found.costate, hand.costate[:, :2], atol=1e-6)
    np.testing.assert_allclose(
        found.sensitivity["history of force"], hand.costate[0, 2:], atol=1e-6
    )
    x, cost = rolled(found, HISTORY)
    np.testing.assert_allclose(found.x, x, atol=1e-7)
    verdict = evaluate(found)
    assert verdict.cost == pytest.approx(cost, rel=1e-12)
    assert verdict.defect < 1e-7


def test_another_history_is_a_run_argument():
    program = MultipleShooting().build(cart())
    other = [1.0, 1.0, 1.0]
    found = program.run(parameters={"history of force": other}).or_raise()
    _, cost = rolled(found, other)
    assert evaluate(found).cost == pytest.approx(cost, rel=1e-12)
    slopes = []
    for step in 1e-3 * np.eye(3):
        low, high = (
            program.run(parameters={"history of force": HISTORY + d}).cost for d in (-step, step)
        )
        slopes.append((high - low) / 2e-3)
    slope = program.run().sensitivity["history of force"]
    np.testing.assert_allclose(slope, slopes, rtol=1e-6)


def test_beside_bounds_rates_and_constants():
    k = ca.SX.sym("k")
    ocp = cart(
        control_bounds=Box([-2, -1], [2, 1]),
        rates=(Rate(F, -0.4, 0.4, weight=0.1),),
        last_input=[0.3],
        unknowns=(Unknown("aim", k, 0.0, -1, 1),),
        terminal_cost=20 * (P - k) ** 2,
        delays=(Delay(F, 3, HISTORY), Delay(G, 1, 0.5)),
    )
    found = solve(ocp, MultipleShooting()).or_raise()
    verdict = evaluate(found)
    assert verdict.cost == pytest.approx(found.cost, rel=1e-9)
    assert verdict.violation < 1e-7
    assert np.abs(np.diff(found.u[:, 0], prepend=0.3)).max() < 0.4 + 1e-7
    guess = Guess(x=[[1, 0], [0, 0]], u=[[0, 0]])
    assert solve(ocp, MultipleShooting(), guess=guess).cost == pytest.approx(found.cost, rel=1e-7)
    assert solve(ocp, MultipleShooting(), guess=found).status.is_success


def test_it_is_certified_kept_and_told(tmp_path):
    ocp = cart(control_bounds=Box(-2, 2))
    found = solve(ocp, LinearMPC()).or_raise()
    assert certify(found).holds
    assert not diagnose(found).findings
    for copy in (pickle.loads(pickle.dumps(found)), Solution.load(found.save(tmp_path / "s"), ocp)):
        assert evaluate(copy).cost == evaluate(found).cost
    with pytest.raises(ProblemError, match="delays differ"):
        Solution.load(tmp_path / "s.npz", cart(control_bounds=Box(-2, 2), delays=(Delay(F, 2),)))
    assert "force acts 3 steps later   (before the start (0.5, -0.2, 0.3))" in ocp.describe()
    units = replace(CART, f=ca.vertcat(P + 0.1 * V, V + 0.1e6 * F + 0.05 * G))
    scaled = cart(
        model=units,
        running_cost=10 * P**2 + V**2 + 0.1e12 * F**2 + G**2,
        delays=(Delay(F, 3, np.array(HISTORY) / 1e6),),
    )
    same = solve(scaled, MultipleShooting()).or_raise()
    assert same.cost == pytest.approx(solve(cart(), MultipleShooting()).cost, rel=1e-8)


def test_bad_input_is_refused():
    flow = Model(name="flow", x=CART.x, u=CART.u, f=ca.vertcat(V, F + G))
    for kind, said, make in (
        (ProblemError, "steps", lambda: Delay(F, 0)),
        (ProblemError, "steps", lambda: Delay(F, 1.5)),  # pyright: ignore[reportArgumentType]
        (ProblemError, "history", lambda: Delay(F, 2, [1, 2, 3])),
        (ProblemError, "has 2 entries; give each", lambda: Delay(CART.u, 2)),
        (ProblemError, "Delay: control", lambda: Delay(2 * F, 2)),
        (ProblemError, "no control; they are force, gust", lambda: cart(delays=(Delay(V, 2),))),
        (ProblemError, "two delays of 'force'", lambda: cart(delays=(Delay(F, 2), Delay(F, 1)))),
        (ProblemError, "an entry of delays", lambda: cart(delays=(3,))),
        (UnsupportedProblem, "continuous in time", lambda: cart(model=flow, horizon=1.0)),
        (UnsupportedProblem, r"MPC\(delay", lambda: MPC(ocp=cart(), solver=LinearMPC(), dt=0.1)),
        (ProblemError, r"MPC\(delay", lambda: Plant(ocp=cart())),
        (UnsupportedProblem, "no part of A and B", lambda: linear_quadratic(cart())),
    ):
        with pytest.raises(kind, match=said):
            make()
    with pytest.raises(ProblemError, match="has 2 entries, 3 are needed"):
        MultipleShooting().build(cart()).run(parameters={"history of force": [1, 2]})
