"""Stagewise Newton finds the minima of multiple shooting, and says so only of minima."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from benchmarks.mpc.arm_loop import loop
from models import seven_links
from models.textbook import rayleigh, van_der_pol
from ocp import (
    OCP,
    RK4,
    Box,
    Compiler,
    Constraint,
    FreeTime,
    Guess,
    Model,
    ProblemError,
    Solution,
    Status,
    UnsupportedProblem,
    solve,
)
from ocp.nlp.transcription import Transcription
from ocp.problem.run_data import RunData
from solvers import MultipleShooting, StagewiseNewton
from solvers.direct.newton.newton_step import Iterate, NewtonStep
from solvers.direct.shooting_grid import ShootingGrid
from tests.linear_dp.problems import unstable_mass
from tests.solvers.problems import OTHER, ends, moving, oscillator, point, quartic, tracker

# The same nonlinear program solved to 1e-9 by two methods: costs differ by its square.
SAME_COST = 1e-10
# Costates and controls differ by the tolerance times a condition number.
SAME_POINT = 1e-6
needs_compiler = pytest.mark.skipif(not Compiler().found, reason="no compiler on this machine")


def free_mass() -> OCP:
    """Discrete in time and linear-quadratic."""
    return unstable_mass(control_bounds=Box(), state_bounds=Box())


def agree(one: Solution, other: Solution) -> None:
    assert one.status is Status.SOLVED, one.message
    assert one.cost == pytest.approx(other.cost, rel=SAME_COST, abs=SAME_COST)
    for part in ("t", "x", "u", "costate"):
        size = 1.0 + np.abs(getattr(other, part)).max()
        np.testing.assert_allclose(
            getattr(one, part), getattr(other, part), atol=SAME_POINT * size, err_msg=part
        )


# -- the same minima ---------------------------------------------------------------------


@pytest.mark.parametrize(
    "make", [van_der_pol, rayleigh, quartic, tracker, free_mass], ids=lambda m: m.__name__
)
def test_the_minimum_of_multiple_shooting(make) -> None:
    ocp = make()
    agree(solve(ocp, StagewiseNewton(40)), solve(ocp, MultipleShooting(40)))


@needs_compiler
@pytest.mark.parametrize("make", [van_der_pol, tracker], ids=lambda m: m.__name__)
def test_compiled_answers_are_the_same(make) -> None:
    slow, fast = (
        solve(make(), StagewiseNewton(20, compiled=c, judged=False)) for c in (False, True)
    )
    assert slow.iterations == fast.iterations
    agree(fast, slow)


def test_data_of_a_run() -> None:
    one, other = StagewiseNewton(30).build(tracker()), MultipleShooting(30).build(tracker())
    data: dict[str, Any] = {"x0": [0.1, -0.2], "t0": 0.7, "parameters": OTHER}
    agree(one.run(**data), other.run(**data))


def test_unstable_dynamics_over_a_long_horizon() -> None:
    """Single shooting overflows here; the gaps keep the states where they are."""
    ocp = moving(lambda x, u: 20.0 * x + x**3 / 10.0 + u, x0=1.0, horizon=3.0,
                 running_cost=lambda x, u: x**2 + u**2)  # fmt: skip
    guess = Guess(x=[[1.0], [0.0]], u=[0.0])
    solution = solve(ocp, StagewiseNewton(300, judged=False), guess=guess)
    agree(solution, solve(ocp, MultipleShooting(300, judged=False), guess=guess))
    # In open loop rounding grows beyond use, and that is said.
    assert solve(ocp, StagewiseNewton(300), guess=guess).status is Status.INACCURATE


@pytest.mark.over_library
@pytest.mark.slow
@pytest.mark.parametrize("number", range(1, 41))
def test_every_arm_scenario(number: int) -> None:
    """From the minimum next to this start; from afar each method may choose its own."""
    ocp = arm_scenario(f"arm-{number:03d}").ocp()
    direct = solve(ocp, MultipleShooting(75)).or_raise()
    program = StagewiseNewton(75).build(ocp)
    cold = program.run()
    assert cold.status is Status.SOLVED, cold.message
    assert cold.iterations < 40  # 26 in arm-019
    near = Guess(x=direct.x, u=0.999 * direct.u, costate=direct.costate)
    agree(program.run(guess=near), direct)


@pytest.mark.slow
def test_seven_links_without_their_limits() -> None:
    ocp = seven_links(gain=10.0, clearance=None, joint_bounds=None)
    # IPOPT scales this cost: at its 1e-9 it still lies 4e-10 above the minimum.
    agree(solve(ocp, StagewiseNewton(30)), solve(ocp, MultipleShooting(30, tolerance=1e-11)))


# -- the step ------------------------------------------------------------------------------


@pytest.mark.parametrize("sigma", [0.0, 3.0])
@pytest.mark.parametrize("make", [tracker, quartic, van_der_pol], ids=lambda m: m.__name__)
def test_the_step_solves_the_newton_equations(make, sigma: float) -> None:
    """At the first node, where the law and its linear model agree, against a dense solve."""
    ocp, n = make(), 4
    nx, nu = ocp.model.nx, ocp.model.nu
    transcription = Transcription(ocp, n, RK4())
    rng = np.random.default_rng(1)
    at = Iterate(*[rng.normal(size=(rows, n + k)) / 3 for rows, k in ((nx, 1), (nu, 0), (nx, 1))])
    data = RunData(ocp.start(), 0.3, ocp.parameter_values())
    program = transcription.program
    lam = ca.MX.sym("lam", nx * n)
    lagrangian = program["f"] - ca.dot(lam, program["g"])
    derivatives = ca.Function("derivatives", [program["x"], lam, program["p"]], [
        *ca.hessian(lagrangian, program["x"]), ca.jacobian(program["g"], program["x"]), program["g"]
    ])  # fmt: skip
    w, costates = transcription.join(at.x.T, at.u.T), at.costate.T[1:].ravel()
    values = derivatives(w, costates, transcription.data_vector(data))
    hessian, slope, jacobian, gap = (np.array(value) for value in values)
    is_control = transcription.join(np.zeros((n + 1, nx)), np.ones((n, nu)))
    hessian += sigma * np.diag(is_control)
    moves = np.arange(len(w)) >= nx  # the start stays
    kkt = np.block([[hessian[moves][:, moves], -jacobian[:, moves].T],
                    [jacobian[:, moves], np.zeros((nx * n, nx * n))]])  # fmt: skip
    dense = np.linalg.solve(kkt, -np.concatenate([slope[moves], gap]))[:, 0]
    dw = np.concatenate([np.zeros(nx), dense[: moves.sum()]])
    start = slope[:nx, 0] + (hessian @ dw)[:nx] - jacobian[:, :nx].T @ dense[moves.sum() :]

    newton = NewtonStep.of(ocp, n, RK4(), fast=False)
    grid = ShootingGrid.of(ocp, transcription.fractions, RK4(), fast=False)
    schedule = [*grid.schedule(data, ocp.duration), data.values.at(1.0)[0]]
    here = newton.linearise(at, schedule)
    step = newton.direction(here, sigma)
    there = newton.trial_iterate(step, here, 1.0, schedule)
    np.testing.assert_allclose(there.u[:, 0] - at.u[:, 0], dw[nx : nx + nu], rtol=1e-9)
    np.testing.assert_allclose(there.costate[:, 0], start, rtol=1e-9)
    cost_slope = float(derivative(program, w, data, transcription) @ dw)
    assert step.slopes.cost_slope == pytest.approx(cost_slope)
    assert step.slopes.directional_curvature == pytest.approx(float(dw @ hessian @ dw))
    half = newton.trial_iterate(step, here, 0.5, schedule)
    before, middle, after = (
        newton.linearise(part, schedule).measures.defect_norm2 for part in (at, half, there)
    )
    assert middle == pytest.approx(0.5 * before)
    assert after == pytest.approx(0.0, abs=1e-12)


def derivative(program: dict, w: np.ndarray, data: RunData, transcription: Transcription):
    """The gradient of the cost in the unknowns."""
    slope = ca.gradient(program["f"], program["x"])
    function = ca.Function("slope", [program["x"], program["p"]], [slope])
    return np.array(function(w, transcription.data_vector(data))).ravel()


# -- how quickly -------------------------------------------------------------------------


def test_a_linear_quadratic_problem_takes_one_step() -> None:
    solution = solve(free_mass(), StagewiseNewton())
    assert solution.status is Status.SOLVED
    assert solution.iterations == 1


def test_the_end_is_quadratic() -> None:
    residuals = solve(van_der_pol(), StagewiseNewton(40, tolerance=1e-13)).history["residual"]
    tail = np.log10(residuals[1:4])
    assert (tail[1:] / tail[:-1] > 1.7).all(), residuals


def test_from_its_own_answer_nothing_is_left_to_do() -> None:
    program = StagewiseNewton(40).build(van_der_pol())
    first = program.run()
    assert program.run(guess=first).iterations == 0


# -- no lies -----------------------------------------------------------------------------


def test_a_maximum_is_left() -> None:
    """At x = u = 0 every slope vanishes, but pi/2 < 2: the conjugate point lies in the horizon."""
    ocp = point(running_cost=lambda x, u: u**2 - 4.0 * ca.sin(x) ** 2)
    solution = solve(ocp, StagewiseNewton(40))
    assert solution.status is Status.SOLVED
    assert solution.cost < -0.1
    agree(solution, solve(ocp, MultipleShooting(40), guess=solution))


@pytest.mark.parametrize(("duration", "status"), [(1.5, Status.SOLVED), (1.65, None)])
def test_the_second_order_condition_fails_at_the_conjugate_point(duration, status) -> None:
    """Of the free oscillator it lies at pi/2; beyond it the cost has no lower bound."""
    solution = solve(oscillator(duration, fixed=False), StagewiseNewton(100, max_iterations=50))
    if status:
        assert solution.status is status
    else:
        assert not solution.status.is_success


@pytest.mark.parametrize(
    "terms",
    [
        {"running_cost": lambda x, u: -(u**2)},
        {"running_cost": lambda x, u: u**2 - 10 * x**2},
        {"running_cost": lambda x, u: x},
        {"terminal_cost": lambda x, u: -3 * x**2},
    ],
    ids=["-u^2", "u^2 - 10 x^2", "x", "-3 x(1)^2"],
)
def test_a_cost_without_lower_bound_is_no_success(terms: dict) -> None:
    """u = 0 is stationary in three of them."""
    solution = solve(point(**terms), StagewiseNewton(20))
    assert not solution.status.is_success
    assert np.isfinite(solution.x).all()


def test_the_iteration_limit_and_a_coarse_integrator_are_told() -> None:
    few = solve(van_der_pol(), StagewiseNewton(20, max_iterations=2))
    assert few.status is Status.ITERATION_LIMIT
    assert "after 2 Newton steps" in few.message
    coarse = solve(moving(lambda x, u: -100 * x + u, x0=1.0), StagewiseNewton(20))
    assert coarse.status is Status.INACCURATE
    assert "a state moves by" in coarse.message


def test_a_control_that_costs_nothing_is_stationary_only() -> None:
    """The cost does not see u_1: its minimum is not a strict one."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u", 2)
    ocp = OCP(
        name="blind",
        model=Model(name="point", x=x, u=u, f=u[0]),
        x0=1.0,
        horizon=1.0,
        running_cost=x**2 + u[0] ** 2,
    )
    solution = solve(ocp, StagewiseNewton(10))
    assert solution.status is Status.STATIONARY
    assert "Q_uu is not positive definite at t = " in solution.message


def test_a_root_that_is_left_is_no_number() -> None:
    """sqrt(x) where x < 0: trials that are not finite are refused, the first iterate is told."""
    ocp = moving(lambda x, u: u, x0=0.5, running_cost=lambda x, u: u**2 + ca.sqrt(x) * 4.0)
    solution = solve(ocp, StagewiseNewton(20), guess=Guess(u=[-1.0]))
    assert solution.status is Status.DIVERGED
    assert "first iterate" in solution.message
    assert np.isfinite(solution.x).all()


# -- bad input ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"state_bounds": Box(-1, 1)}, "takes no state bounds"),
        ({"constraints": ends(1.0)}, "takes no terminal constraint \\('end'\\)"),
        (
            {"constraints": lambda x, u: (Constraint("wall", x, upper=1.0),)},
            "takes no path constraint \\('wall'\\)",
        ),
        ({"horizon": FreeTime(guess=1.0)}, "takes no free final time"),
    ],
)
def test_what_it_refuses(changes: dict, words: str) -> None:
    with pytest.raises(UnsupportedProblem, match=f"point: stagewise Newton {words}"):
        StagewiseNewton().build(point(**changes))


@pytest.mark.parametrize(
    "make",
    [
        lambda: StagewiseNewton(0),
        lambda: StagewiseNewton(max_iterations=0),
        lambda: StagewiseNewton(tolerance=0.0),
        lambda: StagewiseNewton(accuracy=float("nan")),
        lambda: StagewiseNewton(integrator="rk4"),  # pyright: ignore[reportArgumentType]
    ],
)
def test_bad_options(make) -> None:
    with pytest.raises(ProblemError):
        make()


# -- in the loop -------------------------------------------------------------------------


@pytest.mark.slow
@needs_compiler
def test_the_closed_loop_of_the_arm_is_that_of_the_direct_method() -> None:
    loops = {kind: loop(arm_scenario("arm-001"), kind, 0.35) for kind in ("direct", "newton")}
    for rollout in loops.values():
        assert all(source.is_planned for source in rollout.or_raise().sources)
    assert loops["newton"].cost == pytest.approx(loops["direct"].cost, rel=1e-6)
