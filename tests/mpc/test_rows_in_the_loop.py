"""A plan is judged by the rows that its solver was given, at the instants where they hold."""

import casadi as ca
import numpy as np
import pytest

from ocp import MPC, OCP, Box, Constraint, FeedbackLaw, InputSource, Model, Plant, closed_loop
from solvers import MultipleShooting


def tank() -> OCP:
    """A tank that runs dry however it is filled, with a slack control for its level."""
    x, u, slack = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("slack")
    return OCP(
        name="tank",
        model=Model(name="tank", x=x, u=ca.vertcat(u, slack), f=u - 1.0),
        x0=[0.5],
        horizon=1.0,
        running_cost=10.0 * slack**2 + slack + 0.01 * u,
        control_bounds=Box([0.0, 0.0], [0.5, np.inf]),
        constraints=(Constraint("level", x + slack, 0.0, np.inf),),
    )


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_a_constraint_with_a_control_does_not_hold_at_the_last_node(backend) -> None:
    solver = MultipleShooting(10, backend=backend)
    rollout = MPC(ocp=tank(), solver=solver, dt=0.1).run(Plant(ocp=tank()), [0.5], 1.0)
    assert set(rollout.sources) == {InputSource.OPTIMAL}, rollout.messages


def counter() -> OCP:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return OCP(
        name="counter",
        model=Model(name="counter", x=x, u=u, f=x + u, dt=1.0),
        x0=[0.0],
        horizon=5,
        running_cost=u**2,
        control_bounds=Box(-1.0, 1.0),
        constraints=(Constraint("sum", x + u, -np.inf, 1.0),),
    )


def test_in_discrete_time_a_control_belongs_to_the_state_before_it() -> None:
    """x = 0, 1, 1 under u = 1, 0: x + u never exceeds 1; beside the next state it would."""
    law = FeedbackLaw(law=lambda x, t: [1.0 if t < 0.5 else 0.0])
    rollout = closed_loop(law, Plant(ocp=counter()), [0.0], 3.0, dt=1.0)
    assert (rollout.violation, rollout.worst) == (0.0, "")
    beyond = FeedbackLaw(law=lambda x, t: [1.25 if t < 0.5 else 0.0])
    rollout = closed_loop(beyond, Plant(ocp=counter()), [0.0], 3.0, dt=1.0)
    assert rollout.violation == pytest.approx(0.25)
