"""Indirect shooting: ends, starts, bounds, data at run time, continuation, and what it refuses."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.cases import arm_scenario
from models.textbook import (
    bryson_denham,
    discrete_double_integrator,
    double_integrator_minimum_time,
    rayleigh,
    van_der_pol,
)
from ocp import (
    OCP,
    Box,
    Constraint,
    Guess,
    ProblemError,
    Status,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import (
    HorizonContinuation,
    IndirectShooting,
    MultipleShooting,
    ParameterContinuation,
    polish,
)
from tests.solvers.problems import (
    OTHER,
    TRANSFER_COST,
    TRANSFER_TIME,
    changed,
    point,
    quartic,
    saturated_transfer,
    timed_transfer,
    tracker,
    well,
)
from tests.tolerances import CERTIFIED, DIRECT_COST, MINIMISER, STATIONARY

# -- what it takes --------------------------------------------------------------------


@pytest.mark.parametrize("segments", [1, 5])
@pytest.mark.parametrize("jacobian", ["exact", "finite-difference"])
def test_free_final_time(segments: int, jacobian) -> None:
    solver = IndirectShooting(segments=segments, jacobian=jacobian)
    solution = solve(timed_transfer(), solver, guess=Guess(costate=[-1.0, -1.0], duration=1.8))
    assert solution.status is Status.STATIONARY
    assert solution.duration == pytest.approx(TRANSFER_TIME, rel=CERTIFIED)
    assert evaluate(solution).cost == pytest.approx(TRANSFER_COST, rel=CERTIFIED)
    # u(0) = sqrt 2 = -costate_2, and costate_1 = -2 sqrt 2 / T.
    expected = [-2.0 * np.sqrt(2.0) / TRANSFER_TIME, -np.sqrt(2.0)]
    np.testing.assert_allclose(solution.costate[0], expected, rtol=MINIMISER)


def test_a_singular_first_jacobian_is_a_status() -> None:
    """Costates of zero mean no control, and then the final time changes nothing."""
    solution = solve(timed_transfer(), IndirectShooting())
    assert solution.status is Status.NO_PROGRESS
    assert "0 Newton steps" in solution.message
    assert not solution.status.is_success


@pytest.mark.parametrize("segments", [1, 15])
def test_saturated_control(segments: int) -> None:
    ocp, cost = saturated_transfer()
    solution = solve(ocp, IndirectShooting(segments=segments))
    verdict = evaluate(solution)
    assert solution.status is Status.STATIONARY
    # RK4 is of second order in the step over the corner where the control leaves its bound.
    assert verdict.cost == pytest.approx(cost, rel=1e-5)
    assert verdict.violation <= 1e-5
    assert verdict.stationarity is not None
    assert verdict.stationarity <= 1e-4  # as above
    assert np.abs(solution.u).max() == 4.5
    assert solve(ocp, MultipleShooting(200)).cost == pytest.approx(cost, rel=DIRECT_COST)


@pytest.mark.many
@pytest.mark.parametrize("bounds", [Box(), Box(-0.4, 0.4)], ids=["free", "bounded"])
def test_implicit_control(bounds: Box) -> None:
    ocp = quartic(control_bounds=bounds)
    solution = solve(ocp, IndirectShooting(steps=60))
    assert solution.status is Status.STATIONARY
    verdict = evaluate(solution, tolerance=1e-7)  # the root finder makes the referee slow
    assert verdict.stationarity is not None
    assert verdict.stationarity <= STATIONARY
    assert verdict.cost == pytest.approx(solve(ocp, MultipleShooting(200)).cost, rel=DIRECT_COST)


def test_explicit_time_parameters_and_signals_at_run_time() -> None:
    """One build, two runs with other data and another start, each as a direct one."""
    shooting, direct = IndirectShooting().build(tracker()), MultipleShooting(180).build(tracker())
    costs = []
    runs: tuple[dict[str, Any], ...] = (
        {},
        {"parameters": OTHER},
        {"parameters": OTHER, "x0": [-0.4, 0.6], "t0": 0.7},
    )
    for run in runs:
        solution, held = shooting.run(**run), direct.run(**run)
        assert solution.status is Status.STATIONARY
        assert solution.t[0] == run.get("t0", 0.0)
        assert evaluate(solution).cost == pytest.approx(solution.cost, rel=CERTIFIED)
        assert evaluate(held).cost == pytest.approx(solution.cost, rel=DIRECT_COST)
        assert solution.cost <= held.cost
        costs.append(solution.cost)
    assert len(set(np.round(costs, 3))) == 3


@pytest.mark.parametrize("name", ["arm-002", pytest.param("arm-003", marks=pytest.mark.slow)])
def test_manifold_start(name: str) -> None:
    """The costate at t0 has no component along which the start may move (thesis 3.45)."""
    scenario = arm_scenario(name)
    ocp = scenario.ocp(free_start=True)
    held = solve(ocp, MultipleShooting(75))
    solution = solve(ocp, IndirectShooting(segments=15), guess=held)
    assert solution.status is Status.STATIONARY
    assert evaluate(solution).cost == pytest.approx(evaluate(held).cost, rel=DIRECT_COST)
    assert solution.cost < solve(scenario.ocp(), MultipleShooting(75)).cost
    theta = ca.SX.sym("theta", 3)
    jacobian = ca.Function("J", [theta], [scenario.arm.jacobian(theta)])
    for answer, accuracy in ((solution, CERTIFIED), (held, MINIMISER)):
        j = np.array(jacobian(answer.x[0]))
        projector = np.eye(3) - np.linalg.pinv(j) @ j
        along = projector @ answer.costate[0]
        assert np.abs(along).max() <= accuracy * np.abs(answer.costate[0]).max()


@pytest.mark.slow
def test_from_the_costates_of_the_thesis() -> None:
    """psi(t0) = (0, 10, -10) in our sign: plain Newton finds the optimum, the damped one stalls."""
    guess = Guess(costate=[0.0, 10.0, -10.0])
    ocp = arm_scenario("arm-003").ocp()
    plain = solve(ocp, IndirectShooting(steps=150, damped=False), guess=guess)
    assert plain.status is Status.STATIONARY
    assert evaluate(plain).cost == pytest.approx(2.369033299825267, rel=MINIMISER)
    stalled = solve(ocp, IndirectShooting(steps=150), guess=guess)
    assert stalled.status is Status.NO_PROGRESS
    assert "residual" in stalled.message


def test_both_jacobians_take_the_same_steps() -> None:
    exact = solve(van_der_pol(), IndirectShooting())
    varied = solve(van_der_pol(), IndirectShooting(jacobian="finite-difference"))
    np.testing.assert_allclose(exact.x, varied.x, atol=CERTIFIED)
    assert exact.work.jacobians == exact.iterations
    assert varied.work.jacobians == 0
    # Two costates are varied in each step of the finite differences.
    assert varied.work.rollouts >= 1 + 3 * varied.iterations


# -- continuation ---------------------------------------------------------------------


@pytest.mark.parametrize("duration", [3.0, 8.0])
def test_continuation_in_the_horizon(duration: float) -> None:
    ocp = changed(van_der_pol(), horizon=duration)
    assert not solve(ocp, IndirectShooting()).status.is_success
    solution = solve(ocp, IndirectShooting(continuation=HorizonContinuation()))
    assert solution.status is Status.STATIONARY
    assert solution.duration == duration
    assert evaluate(solution).cost == pytest.approx(
        solve(ocp, MultipleShooting(400)).cost, rel=DIRECT_COST
    )


@pytest.mark.slow
def test_continuation_reaches_rayleigh() -> None:
    solution = solve(rayleigh(), IndirectShooting(continuation=HorizonContinuation()))
    assert solution.status is Status.STATIONARY
    assert evaluate(solution).cost == pytest.approx(29.376079655945, rel=1e-6)  # 300 steps
    assert polish(solution).status is Status.SOLVED


def test_continuation_in_a_parameter() -> None:
    ocp = well(depth=1.0)
    assert not solve(ocp, IndirectShooting()).status.is_success
    assert not solve(ocp, IndirectShooting(damped=False)).status.is_success
    solver = IndirectShooting(continuation=ParameterContinuation("gravity", easy=0.0))
    solution = solve(ocp, solver)
    assert solution.status is Status.STATIONARY
    np.testing.assert_array_equal(solution.parameters["gravity"], [1.0])
    assert solution.cost == pytest.approx(solve(ocp, MultipleShooting(150)).cost, rel=DIRECT_COST)
    # The work of all the problems on the way is counted.
    assert solution.work.factorisations == solution.iterations > 10


def test_continuation_is_not_used_where_newton_succeeds() -> None:
    plain = solve(van_der_pol(), IndirectShooting())
    with_one = solve(van_der_pol(), IndirectShooting(continuation=HorizonContinuation()))
    assert with_one.iterations == plain.iterations


def test_continuation_gives_up() -> None:
    """Deep wells escape in finite time whatever the step of the continuation."""
    solver = IndirectShooting(
        steps=60, max_steps=8, continuation=ParameterContinuation("gravity", easy=0.0)
    )
    solution = solve(well(depth=20.0), solver)
    assert not solution.status.is_success
    assert np.isfinite(solution.x).all()


# -- what it refuses ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "term"),
    [
        (
            lambda: point(constraints=lambda x, u: (Constraint("wall", x, upper=1.0),)),
            "no path constraint \\('wall'\\)",
        ),
        (bryson_denham, "state bounds"),
        (double_integrator_minimum_time, "linear in the control acceleration"),
        (lambda: arm_scenario("arm-001").ocp(cost="raw"), "H_uu is singular"),
        (lambda: discrete_double_integrator(5, 0.1), "continuous time"),
        (
            lambda: point(constraints=lambda x, u: (Constraint("goal", x, 1.0, at="terminal"),)),
            "terminal constraint 'goal' is an inequality",
        ),
        (
            lambda: point(
                constraints=lambda x, u: (Constraint("gate", x, 0.0, 1.0, at="initial"),)
            ),
            "initial constraint 'gate' is an inequality",
        ),
    ],
)
def test_refusals_name_the_term(make: Callable[[], OCP], term: str) -> None:
    ocp = make()
    with pytest.raises(UnsupportedProblem, match=term) as error:
        IndirectShooting().build(ocp)
    assert str(error.value).startswith(ocp.name)


def test_polish_refuses_kinks() -> None:
    solution = solve(arm_scenario("arm-003").ocp("closest"), MultipleShooting(20))
    with pytest.raises(UnsupportedProblem, match="kinks"):
        polish(solution)


def test_continuation_in_a_free_horizon_is_refused() -> None:
    with pytest.raises(UnsupportedProblem, match="final time is free"):
        IndirectShooting(continuation=HorizonContinuation()).build(timed_transfer())


@pytest.mark.parametrize(
    "make",
    [
        lambda: IndirectShooting(segments=0),
        lambda: IndirectShooting(segments=10, steps=5),
        lambda: IndirectShooting(jacobian="none"),  # pyright: ignore[reportArgumentType]
        lambda: IndirectShooting(tolerance=0.0),
        lambda: IndirectShooting(delta=-1e-6),
        lambda: IndirectShooting(max_steps=0),
        lambda: HorizonContinuation(first=0.0),
        lambda: HorizonContinuation(first=1.0),
        lambda: ParameterContinuation("gravity", 0.0, first=1.0),
        lambda: IndirectShooting(continuation=ParameterContinuation("mass", 0.0)).build(well()),
        lambda: IndirectShooting(continuation=ParameterContinuation("gravity", [0, 0])).build(
            well()
        ),
        lambda: solve(van_der_pol(), IndirectShooting(), guess=Guess(costate=[1.0, 2.0, 3.0])),
    ],
)
def test_bad_options_and_data(make: Callable[[], object]) -> None:
    with pytest.raises(ProblemError):
        make()


@given(st.integers(1, 7), st.integers(0, 20))
@settings(max_examples=10, deadline=None)
def test_any_number_of_segments(segments: int, more: int) -> None:
    # Signals jump inside the steps of a grid this coarse, which the referee does not accept.
    solver = IndirectShooting(segments=segments, steps=14 + segments + more, judged=False)
    solution = solve(tracker(), solver)
    assert solution.status is Status.STATIONARY
    assert isinstance(solver.steps, int)
    assert len(solution.t) - 1 >= solver.steps
    assert (len(solution.t) - 1) % segments == 0
    assert solution.cost == pytest.approx(0.5551274, rel=2e-2)
