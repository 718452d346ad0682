"""Grids that take in the knots of signals."""

from typing import Literal

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ocp import MPC, OCP, Box, Model, Signal, evaluate, solve
from ocp.internal import node_fractions
from solvers import Collocation, IndirectShooting, MultipleShooting, Schuetz, StagewiseNewton

X, U, R, S = (ca.SX.sym(name) for name in ("x", "u", "r", "s"))
JUMPS = np.array([0.0, 5.0, -3.0, 7.0, 0.0, 2.0, -9.0, 1.0])


def tracking(*signals: Signal, **changes) -> OCP:
    model = Model(name="integrator", x=X, u=U, f=U + R)
    given = {
        "name": "tracking",
        "model": model,
        "x0": [0.0],
        "horizon": 1.0,
        "running_cost": (X - R) ** 2 + 0.01 * U**2,
        "control_bounds": Box(-20.0, 20.0),
        "parameters": signals,
    }
    return OCP(**(given | changes))


def signal(samples, hold: Literal["held", "linear"] = "held") -> Signal:
    return Signal("r", R, samples, hold=hold)


@pytest.mark.many
@pytest.mark.parametrize("hold", ["held", "linear"])
@pytest.mark.parametrize(
    "solver",
    [
        MultipleShooting(75),
        MultipleShooting(75, backend="fatrop"),
        StagewiseNewton(75),
        Schuetz.sound(intervals=75),
        Collocation(25),
    ],
    ids=repr,
)
def test_every_grid_takes_the_knots_in(solver, hold):
    """75 and 25 are no multiples of 7: without the knots the cost was half of the true one."""
    found = solve(tracking(signal(JUMPS, hold)), solver)
    assert found.status.is_success, found.message
    verdict = evaluate(found)
    assert found.cost == pytest.approx(verdict.cost, rel=1e-5)
    knots = np.linspace(0.0, 1.0, len(JUMPS))
    assert np.abs(knots[:, None] - found.fractions).min(axis=1).max() < 1e-12


def test_an_extremal_takes_the_knots_in():
    free = tracking(signal(JUMPS), control_bounds=Box())
    shot = solve(free, IndirectShooting(steps=150, segments=10))
    direct = solve(free, MultipleShooting(300))
    assert shot.status.is_success
    assert shot.cost == pytest.approx(evaluate(shot).cost, rel=1e-6)
    assert shot.cost == pytest.approx(direct.cost, rel=1e-2)


@pytest.mark.slow
@given(
    intervals=st.integers(1, 400),
    samples=st.integers(2, 60),
    others=st.integers(2, 60),
    hold=st.sampled_from(["held", "linear"]),
)
def test_a_grid_has_its_intervals_and_the_knots_that_fit(intervals, samples, others, hold):
    rng = np.random.default_rng(0)
    ocp = tracking(signal(rng.normal(size=samples), hold), Signal("s", S, np.ones(others)))
    nodes = node_fractions(ocp, intervals)
    assert len(nodes) == intervals + 1
    assert (nodes[0], nodes[-1]) == (0.0, 1.0)
    assert (np.diff(nodes) > 0.0).all()
    knots = np.unique(np.round(ocp.parameter_values().knots, 12))
    bending = np.linspace(0.0, 1.0, samples)
    for wanted in (knots, bending):
        if len(wanted) <= intervals + 1:
            assert np.abs(wanted[:, None] - nodes).min(axis=1).max() < 1e-9
    if not (4 * (len(knots) - 1) > intervals):
        halved = node_fractions(ocp, 2 * intervals)
        # 9 intervals miss a knot in the middle, 18 equal ones hit it.
        equal = np.ptp(np.diff(halved)) < 1e-12
        if not equal:
            np.testing.assert_allclose(halved[::2], nodes, atol=1e-12)


@pytest.mark.parametrize("intervals", [7, 21, 70])
def test_knots_that_fit_leave_the_grid_as_it_is(intervals):
    nodes = node_fractions(tracking(signal(JUMPS)), intervals)
    np.testing.assert_array_equal(nodes, np.linspace(0.0, 1.0, intervals + 1))


def test_a_long_table_gives_up_its_straight_parts():
    table = np.clip(np.linspace(-1.0, 2.0, 301), 0.0, 1.0)
    nodes = node_fractions(tracking(signal(table, "linear")), 20)
    for bend in (1 / 3, 2 / 3):
        assert np.abs(nodes - bend).min() < 1e-12
    assert len(nodes) == 21


@pytest.mark.parametrize("solver", [MultipleShooting(10), StagewiseNewton(10)], ids=repr)
def test_a_loop_reads_its_plans_at_its_own_instants(solver) -> None:
    """Nodes between them would move the limits that a plan keeps away from where it is read."""
    asked = tracking(signal([0.0, 5.0, -3.0, 7.0]))
    plan = MPC(ocp=asked, solver=solver, dt=0.1).step([0.0], 0.0).plan
    assert plan is not None
    instants = np.linspace(0.0, 1.0, 11)
    assert np.abs(instants[:, None] - plan.fractions).min(axis=1).max() < 1e-12
