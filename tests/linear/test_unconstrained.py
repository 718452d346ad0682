"""Batch, Riccati, LinearMPC, MultipleShooting and GridDP: one description, one answer."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from models import lq_regulator, mass_spring_damper, stable_plant, thesis_regulator, unstable_plant
from ocp import (
    OCP,
    Box,
    Parameter,
    ProblemError,
    Status,
    UnsupportedProblem,
    evaluate,
    solve,
    with_stationary_end,
)
from solvers import Axis, Batch, GridDP, LinearMPC, MultipleShooting, Riccati
from tests import tolerances
from tests.linear.problems import general, unstable_tracking

SOLVERS = (
    Batch(),
    Riccati(),
    LinearMPC(),
    LinearMPC(form="condensed"),
    MultipleShooting(),
)
PROBLEMS = (
    thesis_regulator(stable_plant(), 20),
    thesis_regulator(unstable_plant(), 20),
    unstable_tracking(),
    general(),
)
PLANTS = (stable_plant(), unstable_plant())
# Cost-to-go from (1, 1, 1) at N = 50, by the plain recursion (2.48) without this toolkit.
COSTS = (4051.255044769, 5280.441131252)


def dense_optimum(ocp: OCP) -> tuple[np.ndarray, np.ndarray]:
    """States and controls from one dense KKT system, its blocks read off by unit vectors."""
    f, n, m, steps = ocp.functions, ocp.model.nx, ocp.model.nu, ocp.steps or 0
    p = ocp.parameter_values().at(np.linspace(0, 1, steps + 1))
    t = (ocp.model.dt or 0) * np.arange(steps + 1)
    size, eye = (steps + 1) * n + steps * m, np.eye(n + m)

    def quadratic(value, width):
        zero, e = value(np.zeros(width)), np.eye(width)
        slope = np.array([(value(v) - value(-v)) / 2 for v in e])
        curve = [[value(v + w) - value(v) - value(w) + zero for w in e] for v in e]
        return np.array(curve), slope

    h, g = np.zeros((size, size)), np.zeros(size)
    rows, right = np.zeros(((steps + 1) * n, size)), np.zeros((steps + 1) * n)
    rows[:n, :n], right[:n] = np.eye(n), ocp.x0
    for k in range(steps):
        at = slice(k * (n + m), (k + 1) * (n + m))
        h[at, at], g[at] = quadratic(
            lambda z, k=k: float(f.running_cost(z[:n], z[n:], t[k], p[k])), n + m
        )
        rate = lambda z, k=k: np.array(f.rate(z[:n], z[n:], t[k], p[k])).ravel()  # noqa: E731
        own = slice((k + 1) * n, (k + 2) * n)
        right[own] = rate(np.zeros(n + m))
        rows[own, at] = -np.array([rate(z) - right[own] for z in eye]).T
        rows[own, (k + 1) * (n + m) : (k + 1) * (n + m) + n] = np.eye(n)
    h[-n:, -n:], g[-n:] = quadratic(lambda z: float(f.terminal_cost(z, t[-1], p[-1])), n)
    zero = np.zeros((len(right), len(right)))
    z = np.linalg.solve(np.block([[h, rows.T], [rows, zero]]), np.append(-g, right))[:size]
    stages = z[: steps * (n + m)].reshape(steps, n + m)
    return np.vstack([stages[:, :n], z[steps * (n + m) :]]), stages[:, n:]


@pytest.mark.many
@pytest.mark.parametrize("ocp", PROBLEMS, ids=lambda p: p.name)
@pytest.mark.parametrize("solver", SOLVERS, ids=repr)
def test_all_solvers_agree_on_the_same_problem(solver, ocp):
    solution, reference = solve(ocp, solver), solve(ocp, Riccati())
    assert solution.status is Status.SOLVED
    np.testing.assert_allclose(solution.u, reference.u, atol=1e-6)
    np.testing.assert_allclose(solution.x, reference.x, atol=1e-5)  # unstable: u times 1.35^20
    scale = np.abs(reference.costate).max()
    np.testing.assert_allclose(solution.costate, reference.costate, atol=1e-6 * scale)
    verdict = evaluate(solution)
    assert verdict.cost == pytest.approx(reference.cost, rel=1e-8)
    assert verdict.violation == 0.0
    assert verdict.stationarity < 1e-4 * scale  # IPOPT's error times 1.35^20


GRID = GridDP(
    states=(Axis(-0.5, 1.5, 121), Axis(-3.0, 1.5, 121)), controls=(Axis(-16.0, 16.0, 65),)
)


@pytest.mark.many
@pytest.mark.parametrize("solver", [*SOLVERS, GRID], ids=lambda s: type(s).__name__)
def test_one_description_five_solvers(solver):
    """The plant 2.92; what a table is allowed is its own estimate of its error."""
    weight = 0.5
    ocp = lq_regulator(
        mass_spring_damper().sampled(0.05),
        Q=[100.0, 10.0],
        R=weight,
        P=100.0,
        x0=[1.0, 0.0],
        horizon=20,
    )
    solution, optimum = solve(ocp, solver), solve(ocp, Riccati())
    assert solution.status is Status.SOLVED
    verdict = evaluate(solution)
    allowed = solution.residual if solver is GRID else 1e-8 * optimum.cost
    assert allowed <= 0.01 * optimum.cost
    assert 0.0 <= verdict.cost - optimum.cost + 1e-9 * optimum.cost <= allowed
    assert solution.cost == pytest.approx(verdict.cost, rel=1e-9)
    # The cost rises by at least R du^2 from its minimum.
    np.testing.assert_allclose(solution.u, optimum.u, atol=np.sqrt(allowed / weight))


@pytest.mark.many
@pytest.mark.parametrize("ocp", PROBLEMS, ids=lambda p: p.name)
def test_riccati_is_the_solution_of_the_dense_kkt_system(ocp):
    x, u = dense_optimum(ocp)
    solution = solve(ocp, Riccati())
    np.testing.assert_allclose(solution.u, u, atol=1e-9)
    np.testing.assert_allclose(solution.x, x, atol=1e-9)


@pytest.mark.many
@pytest.mark.parametrize("steps", [10, 20, 50, 100, 200])
@pytest.mark.parametrize("plant", PLANTS, ids=lambda p: p.name)
def test_batch_is_riccati_on_any_horizon(plant, steps):
    ocp = thesis_regulator(plant, steps)
    batch, riccati = solve(ocp, Batch()), solve(ocp, Riccati())
    assert np.abs(batch.u - riccati.u).max() <= 1e-8 * np.abs(riccati.u).max()
    assert batch.cost == pytest.approx(riccati.cost, rel=1e-12)
    assert batch.status is Status.SOLVED


@pytest.mark.parametrize(("plant", "cost"), list(zip(PLANTS, COSTS, strict=True)))
def test_cost_to_go_of_the_thesis_plants(plant, cost):
    program = Riccati().prepare(thesis_regulator(plant, 50))
    assert program.run().cost == pytest.approx(cost, abs=1e-8)
    assert evaluate(program.run()).cost == pytest.approx(cost, abs=1e-6)
    assert np.ones(3) @ program.P[0] @ np.ones(3) == pytest.approx(cost, abs=1e-8)


@pytest.mark.slow
def test_plain_batch_loses_the_unstable_plant_and_says_so():
    plain = Batch(prestabilise=False)
    good = solve(thesis_regulator(stable_plant(), 100), plain)
    assert good.status is Status.SOLVED
    short = solve(thesis_regulator(unstable_plant(), 10), plain)
    assert short.status is Status.SOLVED
    ocp = thesis_regulator(unstable_plant(), 50)
    wrong, right = solve(ocp, plain), solve(ocp, Riccati())
    assert np.abs(wrong.u - right.u).max() > 1e-3 * np.abs(right.u).max()
    assert wrong.status is Status.FAILED
    assert "prestabilise" in wrong.message
    garbage = solve(thesis_regulator(unstable_plant(), 200), plain)
    assert not garbage.status.is_success
    conditions = [
        plain.prepare(thesis_regulator(unstable_plant(), n)).prediction.condition for n in (20, 50)
    ]
    assert conditions[0] == pytest.approx(4e6, rel=0.1)
    assert 1e14 < conditions[1] < 1e15
    assert Batch().prepare(thesis_regulator(unstable_plant(), 200)).prediction.condition < 100


@pytest.mark.parametrize("plant", PLANTS, ids=lambda p: p.name)
def test_long_recursion_ends_at_the_algebraic_equation(plant):
    p = solve_discrete_are(plant.A, plant.B, 100 * np.eye(3), 500 * np.eye(1))
    long = Riccati().prepare(thesis_regulator(plant, 200))
    assert np.abs(long.P[0] - p).max() <= 1e-9 * np.abs(p).max()
    infinite = Riccati(horizon="infinite").prepare(thesis_regulator(plant, 5))
    for k in range(6):
        assert np.abs(infinite.P[k] - p).max() <= 1e-9 * np.abs(p).max()
    np.testing.assert_allclose(infinite.K[0], long.K[0], rtol=1e-9)
    solution = infinite.run()
    assert evaluate(solution).cost == pytest.approx(np.ones(3) @ p @ np.ones(3), rel=1e-9)


def test_stationary_end_makes_a_short_horizon_as_good_as_a_long_one():
    ocp = unstable_tracking(40)
    reference = np.asarray(ocp.parameters[0].value).copy()
    reference[5:] = reference[5]
    long = solve_with(ocp, reference)
    short = solve_with(unstable_tracking(8), reference[:9], end=True)
    np.testing.assert_allclose(short.u, long.u[:8], atol=1e-5)  # 1.35^-32 of the long end


def solve_with(ocp, reference, *, end=False):
    problem = with_stationary_end(ocp) if end else ocp
    return Riccati().build(problem).run(parameters={"reference": reference})


@pytest.mark.parametrize("solver", SOLVERS[:4], ids=repr)
def test_costates_are_the_gradient_of_the_optimal_cost(solver):
    ocp = general()
    program, step = solver.build(ocp), tolerances.COST_STEP
    costate = program.run().costate[0]
    for i in range(3):
        ends = [program.run(x0=ocp.x0 + s * step * np.eye(3)[i]).cost for s in (1, -1)]
        difference = (ends[0] - ends[1]) / (2 * step)
        assert costate[i] == pytest.approx(difference, abs=tolerances.COST_DERIVATIVE)


@pytest.mark.parametrize("solver", SOLVERS[:4], ids=repr)
def test_run_takes_start_time_and_signals_without_building_again(solver):
    ocp, rng = general(), np.random.default_rng(1)
    given = {"w": rng.normal(size=(16, 3)), "push": [-2.0]}
    program, x0 = solver.build(ocp), [0.0, 2.0, 1.0]
    program.run()
    again = program.run(x0=x0, t0=1.5, parameters=given)
    direct = MultipleShooting().build(ocp).run(x0=x0, t0=1.5, parameters=given)
    np.testing.assert_allclose(again.u, direct.u, atol=1e-6)
    assert again.t[0] == 1.5


@pytest.mark.parametrize("solver", SOLVERS[:2], ids=repr)
def test_constraints_are_refused_by_name(solver):
    ocp = lq_regulator(
        stable_plant(), Q=1.0, R=1.0, x0=np.zeros(3), horizon=5, control_bounds=Box(-1.0, 1.0)
    )
    with pytest.raises(UnsupportedProblem, match="bound of u_0"):
        solver.build(ocp)


def test_infinite_horizon_names_the_mode_that_is_out_of_reach():
    plant = stable_plant()
    unreached = type(plant)(name="split", A=np.diag([1.2, 0.5]), B=np.array([[0.0], [1.0]]), dt=0.1)
    ocp = lq_regulator(unreached, Q=1.0, R=1.0, x0=np.ones(2), horizon=5)
    with pytest.raises(UnsupportedProblem, match=r"not stabilisable.*1\.2"):
        Riccati(horizon="infinite").build(ocp)
    assert solve(ocp, Batch()).status is Status.SOLVED
    marginal = type(plant)(name="drift", A=np.eye(1), B=np.eye(1), dt=0.1)
    unseen = lq_regulator(marginal, Q=0.0, R=1.0, x0=[1.0], horizon=5)
    with pytest.raises(UnsupportedProblem, match="does not see"):
        Riccati(horizon="infinite").build(unseen)
    with pytest.raises(UnsupportedProblem, match="constant"):
        Riccati(horizon="infinite").build(general())
    with pytest.raises(ProblemError, match="horizon"):
        Riccati(horizon="forever")  # type: ignore[arg-type]


def test_parameters_that_make_a_weight_indefinite_are_refused_at_run():

    ocp, price = general(), ca.SX.sym("price")
    priced = replace(
        ocp,
        running_cost=ocp.running_cost + price * ca.sumsqr(ocp.model.u),
        parameters=(*ocp.parameters, Parameter("price", price, 1.0)),
    )
    with pytest.raises(ProblemError, match="R is not positive definite"):
        Riccati().build(priced).run(parameters={"price": -100.0})
