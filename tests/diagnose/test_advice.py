"""Whoever follows the first advice gets further: an answer, or another finding."""

import casadi as ca
import pytest

from benchmarks.mistakes import MISTAKES, Mistake
from benchmarks.mistakes.advice import followed
from ocp import OCP, Box, Model, solve
from solvers import Collocation, MultipleShooting, diagnose, refine_mesh


@pytest.mark.over_library
@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda m: m.name)
def test_advice_leads_on(mistake: Mistake):
    asked = mistake.build()
    first = diagnose(asked).first
    if first is None:
        pytest.skip("one of the few that diagnose does not see")
    then = followed(asked, first)
    found = solve(then.ocp, then.solver)
    if not found.status.is_success:
        second = diagnose(found).first
        assert second is not None, found.message
        if "refine_mesh" in second.sentence:
            assert refine_mesh(found, accuracy=1e-4).solution.status.is_success
            return
        assert (second.cause, second.where) != (first.cause, first.where), found.message


def test_a_single_demand_that_cannot_be_met():
    """Of one demand on one state, the slack was a row beside a column."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    falling = OCP(
        name="falling",
        model=Model(name="body", x=x, u=u, f=u - 1),
        x0=[0.05],
        horizon=2.0,
        running_cost=u**2,
        state_bounds=Box(0.0),
        control_bounds=Box(-0.5, 0.5),
    )
    assert diagnose(falling).serious


@pytest.mark.parametrize("solver", [MultipleShooting(50), Collocation(20)], ids=repr)
def test_a_way_out_that_symmetry_hides_is_found(solver):
    """Heating and cooling warm alike: at u = 0 no slope says so, and the room was INFEASIBLE."""
    x, u = ca.SX.sym("warmth"), ca.SX.sym("heater")
    room = OCP(
        name="room",
        model=Model(name="room", x=x, u=u, f=(5 - x) / 4 + 6 * ca.fabs(u)),
        x0=[20.5],
        horizon=8.0,
        running_cost=u**2,
        state_bounds=Box(20.0, 24.0),
        control_bounds=Box(-2.0, 2.0),
        smoothness=0,
    )
    assert solve(room, solver).status.name != "INFEASIBLE"
