"""Stagewise Newton within bounds of the controls: the minima of multiple shooting, never beyond."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.cases import arm_scenario
from benchmarks.mpc import cart_pole_loop
from models import cart_pole_upright
from models.textbook import pendulum_swing_up
from ocp import OCP, RK4, Box, Compiler, Guess, Model, Solution, Status, evaluate, solve
from ocp.nlp.transcription import Transcription
from ocp.problem.run_data import RunData
from solvers import LinearMPC, MultipleShooting, StagewiseNewton
from solvers.direct.newton.active_bounds import ActiveBounds
from solvers.direct.newton.newton_step import Iterate, Linearisation, NewtonDirection, NewtonStep
from solvers.direct.shooting_grid import ShootingGrid
from tests.linear_dp.problems import unstable_mass
from tests.solvers.problems import changed, moving, point, quartic, tracker
from tests.tolerances import STATIONARY

# IPOPT relaxes bounds by 1e-8 of themselves, so that its cost lies below the minimum by that
# times their multipliers; it ends that far inside or outside of them, too.
SAME_COST = 1e-7
SAME_POINT = 2e-6
needs_compiler = pytest.mark.skipif(not Compiler().found, reason="no compiler on this machine")


def upright() -> OCP:
    """From hanging, 12 N: at a bound most of the time."""
    return cart_pole_loop.problem(1.0)


def upright_from_a_line() -> OCP:
    """The states of the first guess run straight to the top: gaps that 20 N cannot close."""
    up = [0.0, np.pi, 0.0, 0.0]
    start = [0.0, np.pi - 0.4, 0.0, 0.0]
    return changed(cart_pole_upright(track=np.inf), x0=start, guess=Guess(x=[start, up], u=[0.0]))


def arm() -> OCP:
    """Joints that may not turn faster than 0.3 rad/s one way and 0.2 rad/s the other."""
    return changed(arm_scenario("arm-001").ocp("sum"), control_bounds=Box(-0.2, 0.3))


def pendulum() -> OCP:
    """Half the torque that would lift it, and a price for not being up."""
    given = pendulum_swing_up()
    x, u = given.model.x, given.model.u
    return changed(
        given,
        horizon=6.0,
        constraints=(),
        control_bounds=Box(-0.5, 0.5),
        running_cost=u**2 / 2 + (x[0] - np.pi) ** 2,
        terminal_cost=10.0 * ((x[0] - np.pi) ** 2 + x[1] ** 2),
    )


def bounded_tracker() -> OCP:
    """One side only, with everything at run time."""
    return tracker(control_bounds=Box(-0.05, np.inf))


def bounded_quartic() -> OCP:
    return quartic(control_bounds=Box(-0.2, 0.2))


def bounded_mass(limit: float = 8.0) -> OCP:
    """Linear-quadratic, in discrete time."""
    return unstable_mass(state_bounds=Box(), control_bounds=Box(-limit, limit))


def within(solution: Solution) -> Solution:
    """To the last bit."""
    box = solution.problem.control_bounds
    assert (solution.u >= np.asarray(box.lower)).all()
    assert (solution.u <= np.asarray(box.upper)).all()
    return solution


def agree(one: Solution, other: Solution) -> None:
    assert one.status is Status.SOLVED, one.message
    assert one.cost == pytest.approx(other.cost, rel=SAME_COST, abs=SAME_COST)
    for part in ("t", "x", "u", "costate"):
        size = 1.0 + np.abs(getattr(other, part)).max()
        np.testing.assert_allclose(
            getattr(one, part), getattr(other, part), atol=SAME_POINT * size, err_msg=part
        )


def at_bounds(solution: Solution) -> float:
    """The share of controls at a bound."""
    box = solution.problem.control_bounds
    return float(np.mean((solution.u <= box.lower) | (solution.u >= box.upper)))


# -- the same minima ---------------------------------------------------------------------


@pytest.mark.many
@pytest.mark.parametrize(
    ("make", "n"),
    [(bounded_tracker, 40), (bounded_quartic, 40), (bounded_mass, 20), (arm, 30), (upright, 20),
     (upright_from_a_line, 40), (pendulum, 60)],
    ids=lambda v: getattr(v, "__name__", ""),
)  # fmt: skip
def test_the_minimum_of_multiple_shooting(make, n: int) -> None:
    """Cold, each from the problem's own guess; its states are those of its controls."""
    ocp = make()
    mine = within(solve(ocp, StagewiseNewton(n)))
    agree(mine, solve(ocp, MultipleShooting(n, tolerance=1e-10)))
    assert at_bounds(mine) >= 0.1


@pytest.mark.parametrize("make", [upright, pendulum], ids=lambda m: m.__name__)
def test_from_the_answer_of_another_solver(make) -> None:
    """Its controls lie next to their bounds, and the slopes say which ones belong there."""
    ocp = make()
    other = solve(ocp, MultipleShooting(20))
    mine = within(solve(ocp, StagewiseNewton(20), guess=other))
    agree(mine, other)
    assert mine.iterations <= 1


def test_the_referee_finds_it_stationary() -> None:
    """With the integrator's error out of the way: the residual has the clipped controls in it."""
    verdict = evaluate(solve(bounded_tracker(), StagewiseNewton(60)))
    assert verdict.violation == 0.0
    assert verdict.stationarity is not None
    assert verdict.stationarity < STATIONARY


@needs_compiler
def test_compiled_answers_are_the_same() -> None:
    slow, fast = (
        solve(bounded_tracker(), StagewiseNewton(20, compiled=c, judged=False))
        for c in (False, True)
    )
    assert slow.iterations == fast.iterations
    agree(fast, slow)


@pytest.mark.parametrize("limit", [8.0, 20.0, 1000.0])
def test_a_linear_quadratic_problem_takes_one_step(limit: float) -> None:
    ocp = bounded_mass(limit)
    solution = within(solve(ocp, StagewiseNewton()))
    assert solution.iterations == 1
    agree(solution, solve(ocp, LinearMPC()))


def test_the_end_is_quadratic() -> None:
    """Once the right controls are clamped: each residual is the last one's square, times 100.

    That is for slopes per unit of the control; the residual has them per width of the bounds, 0.4.
    """
    solution = solve(bounded_quartic(), StagewiseNewton(40, tolerance=1e-13))
    assert at_bounds(solution) > 0.1
    tail = solution.history["residual"][-3:]
    assert tail[0] < 1e-4
    per_unit = tail / 0.4
    assert (per_unit[1:] < 100.0 * per_unit[:-1] ** 2).all(), tail


def test_from_its_own_answer_nothing_is_left_to_do() -> None:
    program = StagewiseNewton(20).build(upright())
    assert program.run(guess=program.run()).iterations == 0


# -- the step ----------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [0.05, 0.4, 2.0])
def test_the_step_is_the_minimum_of_the_quadratic_model(limit: float) -> None:
    """Slopes and gaps of the linear model: zero, and the multipliers have their signs."""
    ocp, n = tracker(control_bounds=Box(-limit, limit)), 6
    nx, rng = ocp.model.nx, np.random.default_rng(2)
    at = Iterate(*[rng.normal(size=(rows, n + k)) / 3 for rows, k in ((nx, 1), (1, 0), (nx, 1))])
    at.u[:] = ocp.control_bounds.clip(at.u.T).T
    data = RunData(ocp.start(), 0.3, ocp.parameter_values())
    transcription = Transcription(ocp, n, RK4())
    program = transcription.program
    lam = ca.MX.sym("lam", nx * n)
    hessian, slope = ca.hessian(program["f"] - ca.dot(lam, program["g"]), program["x"])
    derivatives = ca.Function("derivatives", [program["x"], lam, program["p"]], [
        hessian, slope, ca.jacobian(program["g"], program["x"]), program["g"]
    ])  # fmt: skip
    w = transcription.join(at.x.T, at.u.T)
    known = derivatives(w, at.costate.T[1:].ravel(), transcription.data_vector(data))
    H, q, A, gap = (np.array(value) for value in known)

    newton = NewtonStep.of(ocp, n, RK4(), fast=False)
    grid = ShootingGrid.of(ocp, np.linspace(0.0, 1.0, n + 1), RK4(), fast=False)
    schedule = grid.schedule(data, ocp.duration)
    here = newton.linearise(at, [*schedule, data.values.at(1.0)[0]])
    step = newton.direction(here)
    assert step.is_settled
    assert step.is_convex
    dx, du, dp = linear_model(here, step)
    dw = transcription.join(dx.T, du.T)
    np.testing.assert_allclose(A @ dw, -gap[:, 0], atol=1e-10)
    left = H @ dw + q[:, 0] - A.T @ dp.T[1:].ravel()
    control = transcription.join(np.zeros((n + 1, nx)), np.ones((n, 1))).astype(bool)
    np.testing.assert_allclose(left[nx:][~control[nx:]], 0.0, atol=1e-9)
    u, g = (at.u + du).ravel(), left[control]
    np.testing.assert_allclose(u, np.clip(u - g, -limit, limit), atol=1e-9)
    assert step.slopes.directional_curvature == pytest.approx(float(dw @ H @ dw))


def linear_model(here: Linearisation, step: NewtonDirection) -> tuple[np.ndarray, ...]:
    """dx, du and dp that the law leads to."""
    stages = here.stages
    nx, n = stages.defects.shape
    nu = len(stages.control_gradient)
    dx, du, dp = np.zeros((nx, n + 1)), np.zeros((nu, n)), np.zeros((nx, n + 1))
    for k in range(n):
        law = step.law[:, (nx + 1) * k : (nx + 1) * (k + 1)] @ np.append(dx[:, k], 1.0)
        du[:, k], dp[:, k] = law[:nu], law[nu:]
        last_first = (nx + nu) * (n - 1 - k)
        moved = np.append(dx[:, k], du[:, k])
        dx[:, k + 1] = (
            stages.jacobian[:, last_first : last_first + nx + nu] @ moved + stages.defects[:, k]
        )
    dp[:, n] = stages.end_hessian @ dx[:, n] + stages.end_gradient[:, 0]
    return dx, du, dp


@given(st.integers(0, 10_000), st.integers(1, 12))
@settings(max_examples=60, deadline=None)
def test_exchanges_end_at_the_minimum(seed: int, size: int) -> None:
    """Of any strictly convex program, also where exchanging all at once cycles."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size))
    matrix, linear = root @ root.T + 0.01 * np.eye(size), rng.normal(size=size)
    bounds = Box(-rng.uniform(0.0, 1.0, size), rng.uniform(0.0, 1.0, size))
    u = bounds.clip(rng.normal(size=size))
    active = ActiveBounds.at(u[:, None], (matrix @ u + linear)[:, None], bounds)
    exchanges = 0
    while True:
        du = active.clamped_step[:, 0]
        held, free = active.clamped[:, 0] == 1, active.clamped[:, 0] == 0
        slope = matrix @ (u + du * held) + linear
        du[free] = -np.linalg.solve(matrix[free][:, free], slope[free])
        slope = matrix @ (u + du) + linear
        check = active.check(du[:, None], (slope * held)[:, None], 1.0)
        if not check.wrong.any():
            break
        assert exchanges < 3**size
        active, exchanges = active.exchanged(check), exchanges + 1
    np.testing.assert_allclose(u + du, bounds.clip(u + du - slope), atol=1e-8)


# -- units -------------------------------------------------------------------------------


def stiff_spring(per_control: float, per_cost: float) -> OCP:
    """A spring that bends, pushed by at most 1 and 0.5, in any units of push and cost."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    push = per_control * u
    return OCP(
        name="in other units",
        model=Model(name="spring", x=x, u=u, f=ca.vertcat(x[1], push - 0.3 * ca.sin(x[0]))),
        x0=[1.0, 0.0],
        horizon=3.0,
        running_cost=per_cost * (ca.sumsqr(x) + 0.1 * push**2),
        control_bounds=Box(-1.0 / per_control, 0.5 / per_control),
    )


@pytest.mark.parametrize(
    ("per_control", "per_cost"), [(1e3, 1e3), (1e5, 1.0), (1e5, 1e5), (1e6, 1e6), (1e9, 1e9)]
)
def test_units_change_neither_status_nor_cost_nor_steps(
    per_control: float, per_cost: float
) -> None:
    plain, other = (
        solve(stiff_spring(*units), StagewiseNewton(40))
        for units in ((1.0, 1.0), (per_control, per_cost))
    )
    assert plain.status is other.status is Status.SOLVED, other.message
    assert other.iterations == plain.iterations
    assert other.cost == pytest.approx(per_cost * plain.cost, rel=1e-12)
    np.testing.assert_allclose(per_control * other.u, plain.u, atol=1e-9)


def low_thrust(duration: float, thrust: float) -> OCP:
    """Come to rest from where half the duration of full thrust would lead; thrust is free."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    return OCP(
        name="low thrust",
        model=Model(name="double integrator", x=x, u=u, f=ca.vertcat(x[1], u)),
        x0=[thrust * duration**2 / 8.0, 0.0],
        horizon=duration,
        running_cost=x[0] ** 2 / duration,
        control_bounds=Box(-thrust, thrust),
    )


@pytest.mark.parametrize("duration", [1e3, 1e4])
def test_weak_controls_end_where_strong_ones_do(duration: float) -> None:
    """Bounds of 1e-4 m/s^2: no step is longer, which relative to the costates is nothing."""
    weak = within(solve(low_thrust(duration, 1e-4), StagewiseNewton(40)))
    plain = solve(low_thrust(1.0, 1.0), MultipleShooting(40, tolerance=1e-10))
    assert weak.status is Status.SOLVED, weak.message
    assert weak.cost / (1e-4 * duration**2) ** 2 == pytest.approx(plain.cost, rel=1e-6)


@pytest.mark.parametrize("duration", [1e4, 1e6])
def test_weak_controls_do_not_pass_for_optimal_ones(duration: float) -> None:
    """Far from the minimum they say so, as far as the same problem in plain units does."""
    few, plain = (
        solve(low_thrust(*given), StagewiseNewton(40, max_iterations=1))
        for given in ((duration, 1e-4), (1.0, 1.0))
    )
    assert few.status is plain.status is Status.ITERATION_LIMIT
    assert few.residual >= plain.residual > 1e3 * StagewiseNewton().tolerance


# -- shapes ------------------------------------------------------------------------------


def test_a_control_without_freedom_stays() -> None:
    """Its bounds are equal; the other one does all the work."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u", 2)
    ocp = OCP(
        name="one is fixed",
        model=Model(name="sum", x=x, u=u, f=u[0] + u[1]),
        x0=1.0,
        horizon=1.0,
        running_cost=x**2 + ca.sumsqr(u),
        control_bounds=Box([0.25, -np.inf], [0.25, 0.0]),
    )
    solution = within(solve(ocp, StagewiseNewton(20), guess=Guess(u=[5.0, 5.0])))
    agree(solution, solve(ocp, MultipleShooting(20)))
    assert (solution.u[:, 0] == 0.25).all()


@pytest.mark.parametrize(
    ("cost", "value"),
    [(lambda x, u: x, -0.5), (lambda x, u: x + u**3, None), (lambda x, u: u, -1.0)],
    ids=["x", "x + u^3", "u"],
)
def test_bang_bang(cost, value: float | None) -> None:
    """No curvature at all: every control is at a bound with a multiplier, a strict minimum.

    int x dt with x = -t is -1/2, int u dt is -1.
    """
    ocp = point(running_cost=cost, control_bounds=Box(-1.0, 1.0))
    solution = within(solve(ocp, StagewiseNewton(20)))
    assert solution.status is Status.SOLVED, solution.message
    assert at_bounds(solution) == 1.0
    if value is not None:
        assert solution.cost == pytest.approx(value)


def test_a_maximum_between_the_bounds_is_left() -> None:
    solution = within(
        solve(point(running_cost=lambda x, u: -(u**2), control_bounds=Box(-1, 1)),
              StagewiseNewton(10))
    )  # fmt: skip
    assert solution.status is Status.SOLVED
    assert solution.cost == pytest.approx(-1.0)


def test_a_control_that_costs_nothing_is_stationary_only() -> None:
    """Within its bounds the cost does not see it."""
    ocp = moving(lambda x, u: -x, x0=1.0, running_cost=lambda x, u: x**2,
                 control_bounds=Box(-1.0, 1.0))  # fmt: skip
    solution = within(solve(ocp, StagewiseNewton(10)))
    assert solution.status is Status.STATIONARY


def test_failures_stay_within() -> None:
    few = within(solve(upright(), StagewiseNewton(20, max_iterations=1)))
    assert few.status is Status.ITERATION_LIMIT
    outside = Guess(u=[100.0])
    assert within(solve(upright(), StagewiseNewton(20, max_iterations=2), guess=outside)).u.any()


# -- in the loop -------------------------------------------------------------------------


@pytest.mark.slow
@needs_compiler
def test_the_closed_loop_of_the_cart_pole_is_that_of_the_direct_method() -> None:
    kinds = ("fatrop", "newton")
    loops = (cart_pole_loop.Setting("nominal", kind, 0.75) for kind in kinds)
    direct, newton = (cart_pole_loop.loop(each).or_raise() for each in loops)
    assert all(source.is_planned for source in newton.sources)
    assert newton.cost == pytest.approx(direct.cost, rel=1e-6)
    assert cart_pole_loop.up_since(newton) == cart_pole_loop.up_since(direct)
