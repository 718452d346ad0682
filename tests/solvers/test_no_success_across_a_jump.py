"""A method that uses derivatives says no success where its trajectory crosses a jump."""

import casadi as ca
import pytest

from ocp import OCP, Box, Model, Status, solve
from solvers import Collocation, GridDP, IndirectShooting, MultipleShooting, StagewiseNewton
from tests.solvers.test_jumps import FAR, V, X, ride


@pytest.mark.parametrize(
    "solver",
    [MultipleShooting(50), Collocation(10), IndirectShooting(segments=15), StagewiseNewton(50)],
    ids=repr,
)
def test_no_success_across_a_jump(solver):
    ground = ride(-ca.if_else(X > FAR, 2.0, 0.1) * V, smoothness=2)
    if isinstance(solver, StagewiseNewton):
        end = 100 * ((X - 1) ** 2 + V**2)
        ground = ride(-ca.if_else(X > FAR, 2.0, 0.1) * V, constraints=(), terminal_cost=end)
    found = solve(ground, solver)
    assert not found.status.is_success
    if found.status is Status.INACCURATE and "jumps" in found.message:
        assert "phase" in found.message


def test_smoothed_as_the_message_says_it_is_solved():
    share = (1 + ca.tanh((X - FAR) / 0.02)) / 2
    found = solve(ride(-(0.1 + 1.9 * share) * V, smoothness=2), MultipleShooting(100))
    assert found.status.is_success


def test_values_alone_need_no_derivative():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    steps = OCP(
        name="steps",
        model=Model(name="point", x=x, u=u, f=u),
        x0=[0.0],
        horizon=1.0,
        running_cost=ca.if_else(x > 0.3, 0.0, 1.0) + u**2,
        state_bounds=Box(0.0, 1.0),
        control_bounds=Box(-1.0, 1.0),
        smoothness=0,
    )
    found = solve(steps, GridDP(states=41, controls=21, intervals=10))
    assert "jumps" not in found.message
