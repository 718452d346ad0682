"""The laws for when there is no plan."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.cases import arm_scenario
from benchmarks.mpc.altered import Altered
from models import lq_regulator, mass_spring_damper
from models.textbook import double_integrator_minimum_time, van_der_pol
from ocp import (
    MPC,
    OCP,
    Box,
    InputSource,
    Plant,
    PlantInput,
    ProblemError,
    Solution,
    UnsupportedProblem,
    instantaneous,
    saturated_lqr,
    solve,
)
from solvers import MultipleShooting, Riccati

BOUND = 30.0


def mass(bound: float | None = None) -> OCP:
    return lq_regulator(
        mass_spring_damper().sampled(0.05),
        Q=[100.0, 10.0],
        R=0.01,
        x0=[1.0, 0.0],
        horizon=400,
        control_bounds=None if bound is None else Box(-bound, bound),
    )


def test_the_regulator_is_that_of_a_long_horizon():
    ocp = mass()
    best = solve(ocp, Riccati())
    np.testing.assert_allclose(saturated_lqr(ocp)(np.array([1.0, 0.0]), 0.0), best.u[0], rtol=1e-8)


def test_references_shift_the_regulator():
    """Led to x = 1: the law is the first step of a long horizon there too."""
    plant = mass_spring_damper().sampled(0.05)
    model = plant.model
    x, u = model.x, model.u
    ocp = OCP(
        name="held at one",
        model=model,
        x0=[0.2, -0.3],
        horizon=400,
        running_cost=100 * (x[0] - 1) ** 2 + 10 * x[1] ** 2 + 0.01 * (u - 2) ** 2,
    )
    expected = solve(ocp, Riccati()).u[0]
    np.testing.assert_allclose(saturated_lqr(ocp)(ocp.start(), 0.0), expected, rtol=1e-8)


@pytest.mark.slow
@given(st.floats(-50, 50), st.floats(-50, 50))
def test_the_regulator_keeps_the_bounds(position, velocity):
    u = saturated_lqr(mass(BOUND))(np.array([position, velocity]), 0.0)
    assert np.isfinite(u).all()
    assert abs(u[0]) <= BOUND


def test_a_nonlinear_problem_has_no_regulator():
    with pytest.raises(UnsupportedProblem, match="not linear"):
        saturated_lqr(van_der_pol(), dt=0.1)


def test_the_arm_descends_the_cost_of_its_posture_in_the_null_space():
    ocp = arm_scenario("arm-001").ocp("sum")
    law, x, reach = instantaneous(ocp, reach=0.2), ocp.start(), 0.2
    u = law(x, 0.0)

    def speed(y):
        return np.array(ocp.functions.rate(x, y, 0.0, [])).ravel()

    def cost(state):
        return float(ocp.functions.running_cost(state, np.zeros(3), 0.0, []))

    gradient = [(cost(x + 1e-6 * e) - cost(x - 1e-6 * e)) / 2e-6 for e in np.eye(3)]
    null = np.stack([speed(e) - speed(np.zeros(3)) for e in np.eye(3)], axis=1)
    np.testing.assert_allclose(u, -reach / 2 * null.T @ gradient, rtol=1e-5, atol=1e-7)


@pytest.mark.slow
def test_a_controller_whose_solver_always_fails_still_passes_the_obstacle():
    """The path is followed by the dynamics; the posture by the law, better than held inputs."""
    scenario = arm_scenario("arm-001")
    ocp = scenario.ocp("sum")

    def closed(backup):
        broken = Altered(MultipleShooting(10), raising)
        mpc = MPC(ocp=ocp, solver=broken, dt=0.05, backup=backup, compiled=False)
        return mpc.run(Plant(ocp=ocp), ocp.start(), ocp.duration)

    rollout = closed(instantaneous(ocp))
    assert set(rollout.sources) == {InputSource.BACKUP}
    still = closed(lambda x, t: np.zeros(3))
    assert rollout.cost < still.cost


def raising(solution: Solution, t0: float) -> Solution:
    """A solver that never answers."""
    raise RuntimeError("no")


def test_the_rate_is_what_the_control_makes_of_the_state():
    ocp = arm_scenario("arm-001").ocp("sum")
    x = ocp.start()
    rate = instantaneous(ocp, sent="rate")(x, 0.0)
    u = instantaneous(ocp)(x, 0.0)
    np.testing.assert_allclose(rate, np.array(ocp.functions.rate(x, u, 0.0, [])).ravel())
    assert PlantInput("rate").size(ocp) == len(np.atleast_1d(rate))
    with pytest.raises(ProblemError, match="neither"):
        instantaneous(ocp, sent="torque")  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("reach", [0.0, -1.0, np.nan])
def test_a_reach_that_is_none_is_refused(reach):
    with pytest.raises(ProblemError, match="reach"):
        instantaneous(van_der_pol(), reach=reach)


def test_a_bang_bang_problem_has_no_instantaneous_law():
    with pytest.raises(UnsupportedProblem, match="linear in the control"):
        instantaneous(double_integrator_minimum_time())


def test_a_state_of_the_wrong_size_is_named():
    with pytest.raises(ProblemError, match="x"):
        instantaneous(van_der_pol())(np.zeros(3), 0.0)
