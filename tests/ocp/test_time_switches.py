"""What switches by the clock is found, by the referee and by every grid."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ocp import OCP, Model, Parameter, evaluate, solve
from ocp.problem.time_switches import time_switches
from solvers import BetweenNodes, Collocation, MultipleShooting, StagewiseNewton

X, U, T, P = (ca.SX.sym(name) for name in "xutp")


def pushed(push: ca.SX, **changes) -> OCP:
    given = {
        "name": "pushed",
        "model": Model(name="mass", x=X, u=U, f=U + push, t=T),
        "x0": [0.0],
        "horizon": 1.0,
        "running_cost": 0.1 * U**2 + X**2,
    }
    return OCP(**(given | changes))


PULSES = {
    "between two instants": ca.logic_and(T > 0.5003, T < 0.5013),
    "near an instant": ca.fabs(T - 0.5008) < 5e-4,
    "within a parabola": (T - 0.5008) ** 2 < 5e-4**2,
}


@pytest.mark.many
@pytest.mark.parametrize("pulse", PULSES.values(), ids=list(PULSES))
@pytest.mark.parametrize(
    "solver",
    [
        MultipleShooting(20),
        MultipleShooting(40),
        StagewiseNewton(40),
        Collocation(25),
        BetweenNodes(MultipleShooting(20)),
    ],
    ids=repr,
)
def test_a_pulse_between_the_nodes_is_no_secret(solver, pulse) -> None:
    """Of a millisecond, and worth half a metre: every node missed it, and the cost was 0."""
    found = solve(pushed(ca.if_else(pulse, 500.0, 0.0)), solver)
    verdict = evaluate(found)
    assert verdict.cost_error <= 1e-2 * verdict.cost
    assert verdict.cost > 0.02
    if found.status.is_success:
        assert found.cost == pytest.approx(verdict.cost, rel=1e-2)


@pytest.mark.slow
def test_what_a_pulse_costs_is_known_to_the_referee() -> None:
    """Without control x = 0.5 from the pulse on, but for 1/3 of it while it lasts."""
    found = solve(
        pushed(ca.if_else(PULSES["between two instants"], 500.0, 0.0)), MultipleShooting(20)
    )
    still = found.with_(u=np.zeros_like(found.u))
    expected = 0.25 * (1.0 - 0.5013) + 0.25 * 0.001 / 3.0
    assert evaluate(still).cost == pytest.approx(expected, rel=1e-6)


def test_a_run_that_begins_later_is_judged_by_its_own_clock() -> None:
    late = pushed(ca.if_else(ca.fabs(T - 3.4008) < 5e-4, 500.0, 0.0))
    found = MultipleShooting(20).build(late).run(t0=3.0)
    assert evaluate(found).cost > 0.02
    assert not found.status.is_success


@pytest.mark.slow
@given(
    at=st.floats(0.01, 0.99),
    width=st.floats(1e-6, 1e-3),
    t0=st.floats(-5.0, 5.0),
    duration=st.floats(0.5, 50.0),
)
def test_both_ends_of_a_pulse_are_found(at, width, t0, duration) -> None:
    middle, half = t0 + at * duration, width * duration / 2
    asked = pushed(
        ca.if_else(ca.fabs(T - P) < half, 1.0, 0.0), parameters=(Parameter("middle", P, middle),)
    )
    found = time_switches(asked, t0, duration, asked.parameter_values())
    ends = (middle - t0 + np.array([-half, half])) / duration
    ends = ends[(ends > 0.0) & (ends < 1.0)]
    assert np.abs(ends[:, None] - found).min(axis=1).max() < 1e-6


def test_what_a_state_decides_is_not_the_clock() -> None:
    asked = pushed(ca.if_else(X > T, 1.0, 0.0))
    assert not len(time_switches(asked, 0.0, 1.0, asked.parameter_values()))
