"""The referee, against CVODES, hand calculation and finite differences."""

from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest

from ocp import (
    OCP,
    Box,
    Constraint,
    Euler,
    FreeTime,
    Guess,
    Model,
    Signal,
    Solution,
    costates_along,
    evaluate,
)
from ocp.referee.chunked_rollout import ChunkedRollout
from ocp.referee.integrate_controls import integrate_controls
from solvers import IndirectShooting, MultipleShooting
from tests.ocp.differences import gradient
from tests.ocp.problems import DURATION, energy, integrator, lag, pendulum, trajectory
from tests.tolerances import DERIVATIVE, MINIMISER, NOT_STATIONARY, REFEREE, ROUNDING, STATIONARY

U_HELD = np.array([[0.5, -1.0], [2.0, 0.3], [-1.5, 0.1], [0.2, 0.9]])
U_LINEAR = np.vstack([U_HELD, [[-0.4, 0.6]]])


# -- the cost -------------------------------------------------------------------------


def by_cvodes(solution: Solution) -> tuple[float, np.ndarray]:
    """Return cost and final state of a solution of the pendulum, piece by piece by CVODES.

    Independent of the referee: own interpolation, other integrator, other step control. On
    each piece between two knots (controls: quarters, signals: thirds and fifths) everything
    is linear in time.
    """
    ocp = solution.problem
    z, s = ca.SX.sym("z", 3), ca.SX.sym("s")
    ends = ca.SX.sym("ends", 2 + 4 + 6)
    t0, t1 = ends[0], ends[1]
    u = ends[2:4] + s * (ends[4:6] - ends[2:4])
    p = ends[6:9] + s * (ends[9:12] - ends[6:9])
    now = (z[:2], u, t0 + s * (t1 - t0), p)
    rate = (t1 - t0) * ca.vertcat(ocp.functions.rate(*now), ocp.functions.running_cost(*now))
    options = {"abstol": 1e-12, "reltol": 1e-12, "max_num_steps": 100000}
    piece = ca.integrator(
        "piece", "cvodes", {"x": z, "t": s, "p": ends, "ode": rate}, 0, 1, options
    )

    def controls(fraction: float, side: int) -> np.ndarray:
        if solution.control_kind == "held":
            return solution.u[int(np.clip(np.floor(4 * (fraction + side * 1e-6)), 0, 3))]
        return np.array([np.interp(4 * fraction, range(5), c) for c in solution.u.T])

    def parameters(fraction: float, side: int) -> np.ndarray:
        held = [0.5, -0.5, 1.0, 0.3][int(np.clip(np.floor(3 * (fraction + side * 1e-6)), 0, 3))]
        linear = np.interp(5 * fraction, range(6), [0.0, 0.4, -0.3, 0.2, 0.6, 0.1])
        return np.array([0.8, held, linear])

    knots = np.unique(np.concatenate([np.arange(n + 1) / n for n in (3, 4, 5)]).round(12))
    state = np.append(solution.x0, 0.0)
    for a, b in pairwise(knots):
        times = solution.t[0] + np.array([a, b]) * DURATION
        drive = [controls(a, 1), controls(b, -1), parameters(a, 1), parameters(b, -1)]
        state = np.array(piece(x0=state, p=np.concatenate([times, *drive]))["xf"]).ravel()
    final = ocp.functions.terminal_cost(state[:2], solution.t[-1], parameters(1.0, 1))
    return float(state[2] + final), state[:2]


@pytest.mark.parametrize("t0", [0.0, 2.0])
@pytest.mark.parametrize(("kind", "u"), [("held", U_HELD), ("linear", U_LINEAR)])
def test_cost_agrees_with_cvodes(kind: str, u: np.ndarray, t0: float) -> None:
    solution = trajectory(pendulum(), u, kind, t=t0 + np.linspace(0.0, DURATION, 5))
    cost, end = by_cvodes(solution)
    verdict = evaluate(solution)
    assert verdict.cost == pytest.approx(cost, abs=REFEREE)
    np.testing.assert_allclose(verdict.truth.x[-1], end, atol=REFEREE)
    assert verdict.cost_error <= REFEREE


def test_refines_until_the_cost_holds_still() -> None:
    solution = trajectory(pendulum(), 20 * U_HELD)
    coarse, fine = (
        integrate_controls(solution, tolerance=1e-3),
        integrate_controls(solution, tolerance=1e-12),
    )
    assert fine.substeps > coarse.substeps
    assert fine.cost_error <= 1e-12 * (1 + abs(fine.cost))
    assert coarse.cost == pytest.approx(fine.cost, rel=1e-3)


def test_judges_the_controls_not_the_solver() -> None:
    """A solution by Euler's method believes in another cost and in other states."""
    ocp = pendulum()
    solution = MultipleShooting(intervals=8, integrator=Euler()).build(ocp).run()
    verdict = evaluate(solution)
    assert abs(verdict.cost - solution.cost) > 1e-2
    assert verdict.defect > 1e-2
    exact = np.stack([np.interp(solution.t, verdict.truth.t, c) for c in verdict.truth.x.T], 1)
    assert evaluate(solution.with_(x=exact)).defect <= ROUNDING


def test_parameters_of_the_run_count() -> None:
    solution = trajectory(pendulum(), U_HELD, parameters={"gain": [3.0]})
    assert abs(evaluate(solution).cost - evaluate(trajectory(pendulum(), U_HELD)).cost) > 0.1


def test_what_blows_up_costs_infinity() -> None:
    """dx/dt = x^2 from 1 is 1 / (1 - t): it leaves every bound at t = 1 s."""
    base = integrator()
    m = base.model
    model = Model(name="burst", x=m.x, u=m.u, f=m.x**2 + m.u)
    ocp = OCP(name="burst", model=model, x0=1.0, horizon=2.0, running_cost=m.u**2)
    solution = trajectory(ocp, np.zeros((5, 1)))
    verdict = evaluate(solution)
    assert verdict.cost == verdict.violation == verdict.defect == np.inf
    assert verdict.stationarity is None
    assert verdict.worst == "the state blows up"
    assert costates_along(solution) is solution


def test_discrete_time_sums_and_does_not_integrate() -> None:
    """x: 1, 0.6, 0.1, 0.35, 0.075; sum of x^2 + u^2 over four steps, plus x^2 at the end."""
    u = np.array([[0.1], [-0.2], [0.3], [-0.1]])
    verdict = evaluate(trajectory(lag(), u))
    x = [1.0, 0.6, 0.1, 0.35, 0.075]
    np.testing.assert_allclose(verdict.truth.x[:, 0], x, atol=ROUNDING)
    expected = sum(v**2 for v in x) + float((u**2).sum())
    assert verdict.cost == pytest.approx(expected, abs=ROUNDING)
    assert verdict.cost_error == 0.0


def test_a_free_start_is_the_solutions_own() -> None:
    m = integrator().model
    start = Constraint("start", m.x, 0.5, 0.5, at="initial")
    ocp = OCP(name="free", model=m, x0=0.0, horizon=1.0, running_cost=m.x**2, constraints=(start,))
    solution = trajectory(ocp, np.zeros((2, 1)), x=np.full((3, 1), 0.7))
    verdict = evaluate(solution)
    assert verdict.cost == pytest.approx(0.49)
    assert verdict.violation == pytest.approx(0.2)
    assert verdict.worst == "initial constraint 'start'"


def test_a_march_is_a_loop_of_any_length() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    step = ChunkedRollout(ca.Function("step", [x, u], [0.9 * x + u, x * u]))
    for k in (1, 2, 127, 128, 129, 300):
        drive, state, expected = np.sin(np.arange(k))[:, None], 1.0, []
        for d in drive[:, 0]:
            expected.append((0.9 * state + d, state * d))
            state = expected[-1][0]
        after, products = step([np.ones(1)], [drive])
        np.testing.assert_allclose(np.hstack([after, products]), expected, atol=ROUNDING)


# -- violations -----------------------------------------------------------------------


def zigzag(**changes) -> Solution:
    """Controls 1, -1, 1 in lines over 1 s: x = t - 2 t^2 at first, 0 at every node.

    Its largest value is 1/8 at t = 1/4 s, its smallest -1/8 at t = 3/4 s.
    """
    return trajectory(integrator(**changes), np.array([[1.0], [-1.0], [1.0]]), "linear")


X = integrator().model.x


def walled(**bounds) -> Solution:
    base = integrator()
    wall = Constraint("wall", base.model.x, at="path", **bounds)
    return zigzag(model=base.model, running_cost=base.running_cost, constraints=(wall,))


def test_finds_what_is_violated_between_the_nodes() -> None:
    verdict = evaluate(walled(upper=0.05))
    assert verdict.violation == pytest.approx(0.125 - 0.05)
    assert verdict.worst == "constraint 'wall' at t = 0.25 s"
    verdict = evaluate(walled(lower=-0.1))
    assert verdict.violation == pytest.approx(0.125 - 0.1)
    assert verdict.worst == "constraint 'wall' at t = 0.75 s"


def test_bounds_of_states_and_controls() -> None:
    verdict = evaluate(zigzag(state_bounds=Box(-1.0, 0.1)))
    assert (verdict.violation, verdict.worst) == (pytest.approx(0.025), "bound of x at t = 0.25 s")
    verdict = evaluate(zigzag(control_bounds=Box(-0.7, 1.0)))
    assert (verdict.violation, verdict.worst) == (pytest.approx(0.3), "bound of u at t = 0.5 s")


def test_a_held_control_is_judged_at_the_end_of_its_interval_too() -> None:
    """u = 1 up to t = 1/2 s, then 0; the constraint u t <= 0.4 is worst just before."""
    base = integrator()
    late = Constraint("late", base.model.u * base.model.t, upper=0.4)
    ocp = integrator(model=base.model, running_cost=base.running_cost, constraints=(late,))
    verdict = evaluate(trajectory(ocp, np.array([[1.0], [0.0]])))
    assert verdict.violation == pytest.approx(0.1)


def test_terminal_constraint_and_invariant() -> None:
    base = integrator()
    m = base.model
    ocp = integrator(
        model=m,
        running_cost=base.running_cost,
        constraints=(Constraint("goal", m.x, 0.3, 0.3, at="terminal"),),
        invariants=(Constraint("still", m.x, 0.0, 0.0),),
    )
    verdict = evaluate(trajectory(ocp, np.array([[1.0], [-1.0], [1.0]]), "linear"))
    assert (verdict.violation, verdict.worst) == (pytest.approx(0.3), "terminal constraint 'goal'")
    assert verdict.task_drift == pytest.approx(0.125)


def test_a_duration_outside_its_bounds() -> None:
    ocp = integrator(horizon=FreeTime(guess=1.0, lower=0.5, upper=2.0))
    solution = trajectory(ocp, np.zeros((2, 1)), t=np.array([0.0, 1.0, 2.5]))
    verdict = evaluate(solution)
    assert (verdict.violation, verdict.worst) == (pytest.approx(0.5), "final time")


def test_nothing_violated_has_no_worst() -> None:
    verdict = evaluate(zigzag())
    assert (verdict.violation, verdict.worst, verdict.task_drift) == (0.0, "", 0.0)


# -- the minimum principle ------------------------------------------------------------


def tracking(**changes) -> OCP:
    """min int u^2 + (x(1) - 1)^2 from 0. u is constant; u^2 + (u - 1)^2 is least at 1/2.

    Along a constant u the costate is 2 (u - 1) and H_u = 4 u - 2.
    """
    base = integrator()
    phi = (base.model.x - 1) ** 2
    given = {"model": base.model, "running_cost": base.running_cost, "terminal_cost": phi}
    return integrator(**(given | changes))


KINDS: Any = pytest.mark.parametrize("kind", ["held", "linear"])


@KINDS
@pytest.mark.parametrize(
    ("upper", "u", "expected"),
    [
        (np.inf, 0.5, 0.0),
        (np.inf, 0.4, 0.4),
        (np.inf, 0.7, 0.8),
        (0.3, 0.3, 0.0),
        (0.3, 0.2, 0.1),
        (0.3, -0.2, 0.5),
    ],
)
def test_stationarity_by_hand(kind: str, upper: float, u: float, expected: float) -> None:
    ocp = tracking(control_bounds=Box(-1.0, upper))
    verdict = evaluate(trajectory(ocp, np.full((5, 1), u), kind))
    assert verdict.stationarity == pytest.approx(expected, abs=1e2 * ROUNDING)
    assert verdict.cost == pytest.approx(u**2 + (u - 1) ** 2)


@pytest.mark.parametrize(
    "ocp",
    [
        pendulum(),
        pendulum(control_bounds=Box(-0.3, [0.2, 1.0])),
        energy(),
        lag(),
        lag(control_bounds=Box(-0.1, 0.1)),
    ],
    ids=["free end", "bounded", "fixed end", "discrete", "discrete, bounded"],
)
def test_stationarity_is_zero_at_an_optimum_and_not_beside_it(ocp: OCP) -> None:
    # Intervals short enough for one RK4 step to be as good as the referee's many.
    solution = MultipleShooting(intervals=60).build(ocp).run().or_raise()
    at_optimum = evaluate(solution).stationarity
    assert at_optimum is not None
    assert at_optimum <= STATIONARY
    beside = evaluate(
        solution.with_(u=solution.u + 0.05 * np.cos(np.arange(len(solution.u)))[:, None])
    )
    assert beside.stationarity is not None
    assert beside.stationarity > NOT_STATIONARY


def test_stationarity_counts_the_final_time() -> None:
    """min int 1 + u^2/2, x: 0 -> 1: T = 1/sqrt(2), cost sqrt(2) (test_optimality)."""
    base = integrator()
    m = base.model
    ocp = OCP(
        name="reach",
        model=m,
        x0=0.0,
        horizon=FreeTime(guess=1.0, lower=0.1, upper=5.0),
        running_cost=1.0 + m.u**2 / 2,
        constraints=(Constraint("end", m.x, 1.0, 1.0, at="terminal"),),
    )
    solution = MultipleShooting(intervals=5).build(ocp).run().or_raise()
    verdict = evaluate(solution)
    assert verdict.cost == pytest.approx(np.sqrt(2.0))
    assert solution.duration == pytest.approx(1 / np.sqrt(2.0))
    assert verdict.stationarity == pytest.approx(0.0, abs=STATIONARY)
    # The best control of a horizon of 1 s: u = 1, costate -1, H = 1 + 1/2 - 1 = 1/2.
    slow = trajectory(ocp, np.ones((5, 1)), costate=-np.ones((6, 1)))
    assert evaluate(slow).stationarity == pytest.approx(0.5)


def test_stationarity_counts_a_cost_of_the_final_time() -> None:
    """min T^2/2 + int u^2/2, x: 0 -> 1: T = 2^(-1/3), cost T^2/2 + 1/(2 T) (test_optimality)."""
    base = integrator()
    m = base.model
    ocp = OCP(
        name="reach",
        model=m,
        x0=0.0,
        horizon=FreeTime(guess=1.0, lower=0.1, upper=5.0),
        running_cost=m.u**2 / 2,
        terminal_cost=m.t**2 / 2,
        constraints=(Constraint("end", m.x, 1.0, 1.0, at="terminal"),),
    )
    solution = MultipleShooting(intervals=5).build(ocp).run().or_raise()
    duration = 2.0 ** (-1.0 / 3.0)
    assert solution.duration == pytest.approx(duration)
    verdict = evaluate(solution)
    assert verdict.cost == pytest.approx(duration**2 / 2 + 1 / (2 * duration))
    assert verdict.stationarity == pytest.approx(0.0, abs=STATIONARY)


def test_stationarity_of_a_discrete_trajectory_by_hand() -> None:
    """2 u_k + l_k+1 with the costates 1.49375, 0.5875, 0.775, 0.15: largest at k = 0."""
    u = np.array([[0.1], [-0.2], [0.3], [-0.1]])
    verdict = evaluate(trajectory(lag(), u))
    assert verdict.stationarity == pytest.approx(2 * 0.1 + 1.49375)


@pytest.mark.parametrize("upper", [5.0, 1.0])
def test_stationarity_knows_signals_that_stretch_and_a_duration_at_its_bound(upper: float) -> None:
    r = ca.SX.sym("r")
    base = pendulum()
    x, u = base.model.x, base.model.u
    f = ca.vertcat(x[1] + 0.1 * u[1], -ca.sin(x[0]) - 0.3 * x[1] + u[0] + 0.8 * r)
    ocp = OCP(
        name="stretch",
        model=Model(name="stretch", x=x, u=u, f=f, t=base.model.t),
        x0=[-0.7, -0.2],
        horizon=FreeTime(guess=0.9, lower=0.2, upper=upper),
        running_cost=ca.sumsqr(u) + 1.0 + 0.1 * base.model.t,
        parameters=(Signal("r", r, [0.0, 1.0, -1.0, 0.5], hold="linear"),),
        constraints=(Constraint("end", x, [1.0, 0.0], [1.0, 0.0], at="terminal"),),
    )
    solution = MultipleShooting(intervals=60).build(ocp).run().or_raise()
    assert (solution.duration == pytest.approx(1.0)) is (upper == 1.0)
    stationarity = evaluate(solution).stationarity
    assert stationarity is not None
    assert stationarity <= STATIONARY
    # An optimum for another duration: everything but the duration is stationary.
    fixed = OCP(
        name="fixed",
        model=ocp.model,
        x0=ocp.x0,
        horizon=0.9,
        running_cost=ocp.running_cost,
        parameters=ocp.parameters,
        constraints=ocp.constraints,
    )
    short = MultipleShooting(intervals=60).build(fixed).run().or_raise()
    assert (evaluate(short).stationarity or 0.0) <= STATIONARY
    off = evaluate(short.with_(problem=ocp)).stationarity
    assert off is not None
    assert off > NOT_STATIONARY


@pytest.mark.parametrize(
    ("bounds", "u", "expected"),
    [
        # Held back by the bound: stationary. Free to leave it: H_u = 4 u - 2, as without it.
        ({"upper": 0.3}, 0.3, 0.0),
        ({"lower": 0.3}, 0.3, 0.8),
        ({"lower": 0.8}, 0.8, 0.0),
        ({"upper": 0.8}, 0.8, 1.2),
    ],
)
def test_an_active_terminal_inequality_pushes_only_one_way(
    bounds: dict, u: float, expected: float
) -> None:
    base = tracking()
    goal = Constraint("goal", base.model.x, at="terminal", **bounds)
    ocp = tracking(
        model=base.model,
        running_cost=base.running_cost,
        terminal_cost=base.terminal_cost,
        constraints=(goal,),
    )
    solution = trajectory(ocp, np.full((4, 1), u), costate=np.full((5, 1), -2 * u))
    assert evaluate(solution).stationarity == pytest.approx(expected, abs=1e2 * ROUNDING)


def test_stationarity_counts_the_start_manifold() -> None:
    """x(0) free on a line x_0 = 0: the costate of x_1 has to vanish there."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    ocp = OCP(
        name="line",
        model=Model(name="m", x=x, u=u, f=ca.vertcat(u, 0)),
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=u**2,
        terminal_cost=(x[1] - 1) ** 2,
        constraints=(Constraint("line", x[0], 0.0, 0.0, at="initial"),),
    )
    for start, expected in ((1.0, 0.0), (0.7, 0.6)):
        solution = trajectory(ocp, np.zeros((3, 1)), x=np.tile([0.0, start], (4, 1)))
        assert evaluate(solution).stationarity == pytest.approx(expected)


def test_no_stationarity_where_a_path_constraint_is_active() -> None:
    assert evaluate(walled(upper=0.125)).stationarity is None
    assert evaluate(walled(upper=0.2)).stationarity is not None
    assert evaluate(zigzag(state_bounds=Box(-0.125, 1.0))).stationarity is None


# -- extremals ------------------------------------------------------------------------


def extremal(ocp: OCP, steps: int = 60) -> Solution:
    program = IndirectShooting(segments=5, steps=steps).build(ocp)
    return program.run(guess=MultipleShooting(intervals=20).build(ocp).run())


def test_an_extremal_is_followed_between_its_nodes() -> None:
    """Energy problem, closed form in problems.energy: exact up to rounding, with cost 6."""
    solution = extremal(energy())
    assert solution.control_kind == "extremal"
    verdict = evaluate(solution)
    assert verdict.cost == pytest.approx(6.0, abs=REFEREE)
    assert verdict.violation <= REFEREE
    assert verdict.stationarity is not None
    assert verdict.stationarity <= REFEREE
    few = solution.with_(**{n: getattr(solution, n)[::20] for n in ("t", "x", "costate", "u")})
    assert evaluate(few).cost == pytest.approx(6.0, abs=REFEREE)


def test_an_extremal_under_signals_and_bounds_is_stationary() -> None:
    ocp = pendulum(control_bounds=Box(-0.3, [0.2, 1.0]))
    solution = extremal(ocp, steps=300)
    verdict = evaluate(solution)
    assert verdict.stationarity is not None
    # Steps of the solver across the corners of a saturated control: order 2 there.
    assert verdict.stationarity <= 10 * STATIONARY
    held = evaluate(MultipleShooting(intervals=20).build(ocp).run()).cost
    assert held - 1e-2 < verdict.cost < held


def test_a_wrong_costate_is_not_stationary() -> None:
    solution = extremal(energy())
    off = solution.with_(costate=solution.costate + 0.1)
    verdict = evaluate(off)
    assert verdict.stationarity is not None
    assert verdict.violation > NOT_STATIONARY


# -- costates along a trajectory ------------------------------------------------------


@pytest.mark.parametrize(("kind", "u"), [("held", U_HELD), ("linear", U_LINEAR)])
def test_costates_along_are_derivatives_of_the_cost(kind: str, u: np.ndarray) -> None:
    """For given controls the costate at t is dJ/dx(t); at t0 the start itself is moved."""
    ocp = pendulum()
    solution = costates_along(trajectory(ocp, u, kind))
    slope = gradient(
        lambda x0: evaluate(trajectory(ocp, u, kind, x0=x0)).cost, ocp.start(), step=1e-3
    )
    # Central differences of a smooth cost at 1e-3: 1e-6 of its third derivative.
    np.testing.assert_allclose(solution.costate[0], slope, atol=MINIMISER)
    final = evaluate(solution).truth.x[-1]
    p = solution.data.values.at(1.0)[0]
    phi_x = np.array(ocp.functions.terminal_gradient(final, DURATION, p)).ravel()
    np.testing.assert_allclose(solution.costate[-1], phi_x, atol=ROUNDING)


def test_costates_along_a_discrete_trajectory() -> None:
    """l_N = 2 x_N; l_k = 2 x_k + 0.5 l_k+1, with the states of the sum test above."""
    u = np.array([[0.1], [-0.2], [0.3], [-0.1]])
    costate = costates_along(trajectory(lag(), u)).costate[:, 0]
    expected = [2 * 0.075]
    for x in (0.35, 0.1, 0.6, 1.0):
        expected.append(2 * x + 0.5 * expected[-1])
    np.testing.assert_allclose(costate, expected[::-1], atol=ROUNDING)


def test_costates_along_a_direct_solution_are_its_multipliers() -> None:
    for ocp in (pendulum(), energy()):
        solution = MultipleShooting(intervals=60).build(ocp).run()
        np.testing.assert_allclose(
            costates_along(solution).costate, solution.costate, atol=10 * DERIVATIVE
        )


def test_costates_along_make_any_trajectory_a_start_for_shooting() -> None:
    ocp = pendulum()
    start = costates_along(trajectory(ocp, U_LINEAR, "linear"))
    found = IndirectShooting(segments=5, steps=60).build(ocp).run(guess=start).or_raise()
    direct = MultipleShooting(intervals=60).build(ocp).run(guess=Guess(u=[0.0, 0.0]))
    assert evaluate(found).cost == pytest.approx(evaluate(direct).cost, rel=1e-3)


def test_a_discrete_control_meets_its_constraints_at_the_start_of_its_step_only():
    """x + u >= 1/2 with x+ = x + u: the last control has no constraint with the last state."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    ocp = OCP(
        name="mixed",
        model=Model(name="sum", x=x, u=u, f=x + u, dt=1.0),
        x0=1.0,
        horizon=2,
        running_cost=x**2 + u**2,
        constraints=(Constraint("mixed", ca.vertcat(x + u, x), lower=[0.5, 0.4]),),
    )
    controls = np.array([[-0.5], [0.0]])
    assert evaluate(trajectory(ocp, controls)).violation == 0.0
    worse = evaluate(trajectory(ocp, np.array([[-0.5], [-0.2]])))
    assert worse.violation == pytest.approx(0.2)
    assert "'mixed' at t = 1 s" in worse.worst


@pytest.mark.parametrize("apart", [1e-8, 1e-11, 1e-14])
@pytest.mark.parametrize("kind", ["linear", "held"])
@pytest.mark.filterwarnings("error")
def test_stationarity_of_nodes_closer_than_any_step(kind: Any, apart: float) -> None:
    """They carry no part of the cost: nothing is divided by their length."""
    ocp = integrator()
    t = np.array([0.0, 0.5, 0.5 + apart, 0.5 + 2.0 * apart, 1.0]) * ocp.duration
    rows = 4 if kind == "held" else 5
    plain = trajectory(ocp, np.ones((4, 1))).with_(control_kind=kind, u=np.ones((rows, 1)))
    close, even = evaluate(plain.with_(t=t)), evaluate(plain)
    assert close.cost == pytest.approx(even.cost, rel=REFEREE)
    assert close.stationarity is not None
    assert np.isfinite(close.stationarity)
