"""Constraints at instants: every method, prices and jumps, the referee, and bad input."""

import pickle

import casadi as ca
import numpy as np
import pytest

from ocp import (
    MPC,
    OCP,
    Constraint,
    FreeTime,
    Measurement,
    Model,
    Parameter,
    ProblemError,
    Soft,
    Solution,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import Collocation, MultipleShooting, polish

Z, U, S = ca.SX.sym("z", 2), ca.SX.sym("u"), ca.SX.sym("s")
MASS = Model(name="mass", x=Z, u=U, f=ca.vertcat(Z[1], U))
ARRIVE = Constraint("arrive", Z, [1, 0], [1, 0], at="terminal")
GATE = Constraint("gate", Z[0], 0.5, 0.5, at=0.3)


def transfer(*constraints: Constraint, **changes) -> OCP:
    given = {
        "name": "transfer",
        "model": MASS,
        "x0": [0.0, 0.0],
        "horizon": 1.0,
        "running_cost": U**2 / 2,
        "constraints": (ARRIVE, *constraints),
    }
    return OCP(**(given | changes))


def closed_form(place: float, t: float = 0.3) -> float:
    """Two cubics that meet at a place at t with the speed that costs least."""
    v = ca.SX.sym("v")

    def part(rise, first, last, h):
        squares = first**2 + first * last + last**2
        return 6 * rise**2 / h**3 - 6 * rise * (first + last) / h**2 + 2 * squares / h

    cost = part(place, 0, v, t) + part(1 - place, v, 0, 1 - t)
    slope, curvature = ca.gradient(cost, v), ca.hessian(cost, v)[0]
    least = -ca.substitute(slope, v, 0) / curvature
    return float(ca.evalf(ca.substitute(cost, v, least)))


def test_a_waypoint_has_its_closed_form_by_three_methods():
    ocp, cost = transfer(GATE), closed_form(0.5)
    step = 1e-3
    price = (closed_form(0.5 + step) - closed_form(0.5 - step)) / (2 * step)
    direct = solve(ocp, MultipleShooting(100)).or_raise()
    collocated = solve(ocp, Collocation(20)).or_raise()
    exact = polish(direct).or_raise()
    for found, accuracy in ((direct, 1e-2), (collocated, 1e-8), (exact, 1e-8)):
        assert found.cost == pytest.approx(cost, rel=accuracy)
        assert found.state(0.3)[0] == pytest.approx(0.5, abs=1e-7)
        # dJ*/d(place): the price of an upper bound, with its sign.
        assert found.multipliers["gate"][0, 0] == pytest.approx(-price, rel=max(accuracy, 1e-5))
        before = found.costate_at(0.3)[0]
        after = found.costate[np.searchsorted(found.t, 0.3 + 1e-9), 0]
        assert before - after == pytest.approx(-price, rel=max(accuracy, 1e-5))
        assert evaluate(found).violation < 1e-7


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_several_instants_and_what_is_not_linear(backend):
    ring = Constraint("ring", ca.vertcat(ca.sin(Z[0]), Z[1]), [-1, 0.5], [0.6, 1.2], at=(0.4, 0.8))
    found = solve(transfer(ring), MultipleShooting(40, backend=backend)).or_raise()
    for t in (0.4, 0.8):
        x = found.state(t)
        assert np.sin(x[0]) < 0.6 + 1e-6
        assert 0.5 - 1e-6 < x[1] < 1.2 + 1e-6
    prices = found.multipliers["ring"]
    assert prices.shape == (2, 2)
    assert (np.abs(prices) > 1e-3).any()
    assert evaluate(found).violation < 1e-6
    exact = solve(transfer(ring), Collocation(20)).or_raise()
    np.testing.assert_allclose(prices, exact.multipliers["ring"], atol=2e-2 * np.abs(prices).max())


def test_steps_in_discrete_time():
    step = Model(name="steps", x=Z, u=U, dt=0.1, f=ca.vertcat(Z[0] + 0.1 * Z[1], Z[1] + 0.1 * U))
    gate = Constraint("gate", Z[0], 0.5, 0.5, at=(0.3, 1.0))
    ocp = transfer(gate, model=step, horizon=10, constraints=(gate,))
    found = solve(ocp, MultipleShooting()).or_raise()
    # The least norm of the inputs: position after k steps is the sum of 0.01 (k - 1 - i) u_i.
    rows = np.array([[0.01 * max(0, k - 1 - i) for i in range(10)] for k in (3, 10)])
    least = np.linalg.pinv(rows) @ [0.5, 0.5]
    np.testing.assert_allclose(found.u.ravel(), least, atol=1e-7)
    assert found.cost == pytest.approx(least @ least / 2, rel=1e-9)
    assert evaluate(found).violation < 1e-8


def test_the_referee_sees_what_is_missed():
    found = solve(transfer(), MultipleShooting(40)).or_raise()
    verdict = evaluate(found.with_(problem=transfer(GATE)))
    assert verdict.violation == pytest.approx(abs(found.state(0.3)[0] - 0.5), abs=1e-3)
    assert verdict.worst == "constraint 'gate' at t = 0.3 s"


def test_a_failure_names_constraint_and_instant():
    gates = GATE, Constraint("other", Z[0], 0.7, 0.8, at=0.3)
    found = solve(transfer(*gates), MultipleShooting(20))
    assert not found.status.is_success
    assert "at 0.3 s" in found.message


def test_data_and_waypoints_jump_together():
    seen = Measurement("place", Z[0], [0.5], [0.4], 0.1)
    names = (Parameter("data", ca.SX.sym("a"), 1.0), Parameter("instants of gate", S, 1.0))
    ocp = transfer(GATE, data=(seen,), parameters=names)
    exact = polish(solve(ocp, MultipleShooting(50))).or_raise()
    collocated = solve(ocp, Collocation(20)).or_raise()
    assert collocated.cost == pytest.approx(exact.cost, rel=1e-8)
    jump = exact.costate_at(0.5)[0] - exact.costate_at(0.5 + 1e-7)[0]
    assert jump == pytest.approx(2 * (exact.state(0.5)[0] - 0.4) / 0.1**2, rel=1e-4)


def test_a_solution_is_kept_with_its_instants(tmp_path):
    ocp = transfer(GATE)
    found = solve(ocp, MultipleShooting(20)).or_raise()
    again = Solution.load(found.save(tmp_path / "gate.npz"), ocp)
    np.testing.assert_array_equal(again.multipliers["gate"], found.multipliers["gate"])
    moved = transfer(Constraint("gate", Z[0], 0.5, 0.5, at=0.4))
    with pytest.raises(ProblemError, match="instants constraints differ"):
        Solution.load(tmp_path / "gate.npz", moved)
    copy = pickle.loads(pickle.dumps(ocp))
    assert solve(copy, MultipleShooting(20)).cost == pytest.approx(found.cost, rel=1e-12)
    assert "z_0 = 0.5   (gate, at t = 0.3)" in ocp.describe()


# -- what is refused ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("at", "said"),
    [
        (np.nan, "instants must be finite and increase"),
        ([0.5, 0.5], "instants must be finite and increase"),
        ([0.5, 0.2], "instants must be finite and increase"),
        ((), "times are given for at='instants'"),
        ("instants", "times are given for at='instants'"),
        ("gate", "is no place"),
        (True, "not numeric"),
        (None, "is no place"),
        (["a"], "not numeric"),
    ],
)
def test_instants_that_are_none(at, said):
    with pytest.raises(ProblemError, match=said):
        Constraint("gate", Z[0], 0.5, 0.5, at=at)


@pytest.mark.parametrize(
    ("gate", "changes", "said"),
    [
        (Constraint("gate", Z[0], 0, 1, at=1.5), {}, "t = 1.5 s is not within the horizon of 1 s"),
        (Constraint("gate", Z[0], 0, 1, at=-0.5), {}, "t = -0.5 s is not within"),
        (Constraint("gate", Z[0], 0, 1, at=0.0), {}, "write at='initial'"),
        (Constraint("gate", U, 0, 1, at=0.5), {}, "gate"),
        (GATE, {"horizon": FreeTime(1.0)}, "the final time is free"),
    ],
)
def test_instants_that_do_not_fit_the_problem(gate, changes, said):
    with pytest.raises(ProblemError, match=said):
        transfer(gate, **changes)


def test_a_soft_waypoint_is_a_cost():
    with pytest.raises(ProblemError, match="write the price of this one into a cost"):
        Constraint("gate", Z[0], 0, 1, at=0.5, soft=Soft(linear=1.0))


def test_a_loop_has_no_instants():
    with pytest.raises(UnsupportedProblem, match="'gate' holds at instants"):
        MPC(ocp=transfer(GATE), solver=MultipleShooting(20), dt=0.05)
