"""What methods that start from a given state and end at a given time refuse."""

import casadi as ca
import pytest

from ocp import OCP, Constraint, FreeTime, Model, UnsupportedProblem
from solvers import Greedy, GridDP


@pytest.mark.parametrize("solver", [Greedy(), GridDP()], ids=lambda s: type(s).__name__)
def test_free_ends_are_refused(solver):
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    model, name = Model(name="walk", x=x, u=u, f=u), type(solver).__name__
    given = {"name": "p", "model": model, "x0": 0.0, "running_cost": 1 + u**2}
    with pytest.raises(UnsupportedProblem, match=f"{name} takes no free final time"):
        solver.build(OCP(**given, horizon=FreeTime(guess=1.0)))
    free = OCP(**given, horizon=1.0, constraints=(Constraint("c", x, 0.0, 0.0, at="initial"),))
    with pytest.raises(UnsupportedProblem, match=rf"{name} takes no free start \('c'\)"):
        solver.build(free)
