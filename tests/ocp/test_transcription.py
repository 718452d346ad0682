"""The nonlinear program: layout, rows, and multipliers that are costates."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ocp import OCP, RK4, Box, Constraint, FreeTime
from ocp.integration.one_step import Stage
from ocp.nlp.transcription import Transcription
from ocp.problem.run_data import RunData
from solvers import MultipleShooting
from tests.ocp.differences import gradient
from tests.ocp.problems import energy, integrator, lag, pendulum
from tests.tolerances import COST_DERIVATIVE, COST_STEP, DERIVATIVE, ROUNDING

FREE = FreeTime(guess=1.3, lower=0.5, upper=2.0)


def everything() -> OCP:
    """The pendulum with constraints at all places, an invariant, and a free start."""
    base = pendulum()
    x, u, t = base.model.x, base.model.u, base.model.t
    return OCP(
        name="everything",
        model=base.model,
        x0=base.x0,
        horizon=base.horizon,
        running_cost=base.running_cost,
        terminal_cost=base.terminal_cost,
        parameters=base.parameters,
        constraints=(
            Constraint("mixed", ca.vertcat(x[0] * u[0], u[1] + t), -9.0, 9.0),
            Constraint("circle", x[0] ** 2 + 2 * x[1] ** 2, 0.5, 0.5, at="initial"),
            Constraint("wall", x[0], upper=4.0),
            Constraint("goal", x[1], 0.1, 0.1, at="terminal"),
        ),
        invariants=(Constraint("kept", x[0] - x[1], -3.0, 3.0),),
    )


# -- layout ---------------------------------------------------------------------------


@given(st.integers(1, 7), st.booleans(), st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_join_and_split_are_inverse(n: int, free: bool, seed: int) -> None:
    tr = Transcription(JOINED[free], n, RK4())
    rng = np.random.default_rng(seed)
    z, u = rng.normal(size=(n + 1, tr.nz)), rng.normal(size=(n, 2))
    w = tr.join(z, u)
    assert w.shape == (tr.size,)
    for got, given_ in zip(tr.split(w), (z, u), strict=True):
        np.testing.assert_array_equal(got, given_)
    np.testing.assert_array_equal(tr.join(*tr.split(w)), w)


JOINED = {False: pendulum(), True: pendulum(horizon=FREE)}


def evaluated(tr: Transcription, w: np.ndarray, data: RunData) -> tuple[float, np.ndarray]:
    program = tr.program
    function = ca.Function("fg", [program["x"], program["p"]], [program["f"], program["g"]])
    f, g = function(w, tr.data_vector(data))
    return float(f), np.array(g).ravel()


def data_of(ocp: OCP, t0: float = 0.0) -> RunData:
    return RunData.of(ocp, t0=t0)


def test_every_row_is_the_one_it_says() -> None:
    ocp, n, rng = everything(), 4, np.random.default_rng(0)
    tr = Transcription(ocp, n, RK4())
    z, u = rng.normal(size=(n + 1, 2)), rng.normal(size=(n, 2))
    data = data_of(ocp, 0.3)
    _, g = evaluated(tr, tr.join(z, u), data)
    assert len(tr.rows) == len(g)
    t = 0.3 + tr.fractions * ocp.duration
    expected = {
        ("mixed", "path"): lambda k: [z[k, 0] * u[k, 0], u[k, 1] + t[k]],
        ("wall", "path"): lambda k: [z[k, 0]],
        ("circle", "initial"): lambda k: [z[k, 0] ** 2 + 2 * z[k, 1] ** 2],
        ("goal", "terminal"): lambda k: [z[k, 1]],
    }
    seen: dict[tuple[str, int], list[float]] = {}
    for row, value in zip(tr.rows, g, strict=True):
        if row.place == "dynamics":
            continue
        seen.setdefault((row.name, row.node), []).append(value)
    for (name, place), value in expected.items():
        nodes = [node for (which, node) in seen if which == name]
        wanted = {
            "mixed": range(n),
            "wall": range(n + 1),
            "circle": [0],
            "goal": [n],
        }[name]
        assert sorted(nodes) == list(wanted), place
        for k in nodes:
            np.testing.assert_allclose(seen[name, k], value(k), atol=ROUNDING)


@pytest.mark.parametrize("horizon", [1.5, FREE])
@pytest.mark.parametrize("t0", [0.0, 2.0])
def test_an_exact_trajectory_is_feasible_and_costs_what_it_costs(horizon, t0: float) -> None:
    ocp, n, rng = pendulum(horizon=horizon), 7, np.random.default_rng(3)
    tr, data, u = Transcription(ocp, n, RK4(2)), data_of(ocp, t0), rng.normal(size=(n, 2))
    step = Stage.of(ocp, RK4(2), held=True).step
    left, right = data.values.on(tr.fractions)
    t, x, cost = t0 + ocp.duration * tr.fractions, [ocp.start()], 0.0
    for k in range(n):
        after, c = step(x[k], u[k], t[k], t[k + 1] - t[k], left[k], right[k])
        x.append(np.array(after).ravel())
        cost += float(c)
    z = np.array(x)
    cost += float(ocp.functions.terminal_cost(z[-1], t0 + ocp.duration, data.values.at(1.0)[0]))
    z = np.hstack([z, np.full((n + 1, 1), ocp.duration)]) if ocp.has_free_time else z
    f, g = evaluated(tr, tr.join(z, u), data)
    bounds = tr.bounds(data)
    np.testing.assert_allclose(g, 0.0, atol=ROUNDING)
    assert f == pytest.approx(cost, abs=1e2 * ROUNDING)
    assert tr.worst(tr.join(z, u), g, bounds)[0] <= ROUNDING


def test_a_jump_of_the_state_shows_in_the_two_gaps_around_it() -> None:
    ocp = pendulum()
    tr, data = Transcription(ocp, 5, RK4()), data_of(ocp)
    z, u = np.zeros((6, 2)), np.zeros((5, 2))
    before = evaluated(tr, tr.join(z, u), data)[1]
    z[2] += 0.1
    changed = np.abs(evaluated(tr, tr.join(z, u), data)[1] - before) > ROUNDING
    assert {tr.rows[i].node for i in np.flatnonzero(changed)} == {2, 3}
    assert all(tr.rows[i].place == "dynamics" for i in np.flatnonzero(changed))


def test_the_worst_row_is_named() -> None:
    ocp = everything()
    tr, data = Transcription(ocp, 4, RK4()), data_of(ocp)
    bounds = tr.bounds(data)
    w, g = (np.clip(0.0, bounds[f"lb{v}"], bounds[f"ub{v}"]) for v in "xg")
    assert tr.worst(w, g, bounds) == (0.0, None)
    wall = next(i for i, r in enumerate(tr.rows) if (r.name, r.node) == ("wall", 3))
    g[wall] = 4.5
    violation, row = tr.worst(w, g, bounds)
    assert violation == pytest.approx(0.5)
    assert row == tr.rows[wall]


@pytest.mark.parametrize(
    ("index", "name", "node"),
    [(0, "x_0", 0), (4 * 2 + 1, "x_1", 2), (4 * 3 + 2, "u_0", 3), (4 * 5, "x_0", 5)],
)
def test_the_worst_bound_is_named(index: int, name: str, node: int) -> None:
    ocp = pendulum(control_bounds=Box(-1.0, 1.0), state_bounds=Box(-2.0, 2.0))
    tr = Transcription(ocp, 5, RK4())
    bounds = tr.bounds(data_of(ocp))
    w = np.clip(0.0, bounds["lbx"], bounds["ubx"])
    w[index] = bounds["ubx"][index] + 0.25
    violation, row = tr.worst(w, np.zeros(len(tr.rows)), bounds)
    assert violation == pytest.approx(0.25)
    assert row is not None
    assert (row.name, row.node) == (f"bound of {name}", node)


def test_what_a_fixed_start_decides_is_not_imposed_there() -> None:
    base = integrator(x0=2.0)
    ocp = OCP(
        name="outside",
        model=base.model,
        x0=2.0,
        horizon=1.0,
        running_cost=base.running_cost,
        constraints=(
            Constraint("wall", base.model.x, upper=1.0),
            Constraint("force", base.model.x * base.model.u, -5.0, 5.0),
        ),
    )
    rows = {(r.name, r.node): r for r in Transcription(ocp, 3, RK4()).rows if r.place == "path"}
    assert rows["wall", 0].upper == np.inf
    assert rows["wall", 1].upper == 1.0
    assert rows["wall", 3].upper == 1.0
    assert rows["force", 0].upper == 5.0
    assert ("force", 3) not in rows


def test_a_discrete_problem_brings_its_own_grid() -> None:
    assert Transcription(lag(), 99, RK4()).n == 4


# -- costates -------------------------------------------------------------------------


def optimal_cost(program, x0: np.ndarray) -> float:
    return program.run(x0=x0).or_raise().cost


@pytest.mark.parametrize(
    "ocp",
    [pendulum(), pendulum(control_bounds=Box(-0.3, [0.2, 1.0])), energy(), lag()],
    ids=["free end", "bounded control", "fixed end", "discrete"],
)
def test_the_first_costate_is_the_derivative_of_the_optimal_cost(ocp: OCP) -> None:
    program = MultipleShooting(intervals=10, judged=False).build(ocp)
    costate = program.run().or_raise().costate[0]
    slope = gradient(lambda x0: optimal_cost(program, x0), ocp.start(), COST_STEP)
    np.testing.assert_allclose(costate, slope, atol=COST_DERIVATIVE)


@pytest.mark.parametrize(
    "ocp",
    [pendulum(), pendulum(horizon=FREE), energy(), lag(), everything()],
    ids=["free end", "free time", "fixed end", "discrete", "free start"],
)
def test_costates_solve_the_adjoint_equation(ocp: OCP) -> None:
    """At every node, the first included: costate_k is the stage's adjoint of costate_k+1."""
    solution = MultipleShooting(intervals=10, judged=False).build(ocp).run().or_raise()
    adjoint = Stage.of(ocp, RK4(), held=True).adjoint
    left, right = solution.data.values.on(solution.fractions)
    h = np.diff(solution.t)
    for k in range(len(h)):
        before, _ = adjoint(
            solution.costate[k + 1],
            solution.x[k],
            solution.u[k],
            solution.t[k],
            h[k],
            left[k],
            right[k],
        )
        np.testing.assert_allclose(np.array(before).ravel(), solution.costate[k], atol=DERIVATIVE)


def test_a_free_end_has_the_gradient_of_the_terminal_cost() -> None:
    ocp = pendulum()
    solution = MultipleShooting(intervals=10, judged=False).build(ocp).run().or_raise()
    p = solution.data.values.at(1.0)[0]
    gradient_ = np.array(ocp.functions.terminal_gradient(solution.x[-1], solution.t[-1], p))
    np.testing.assert_allclose(solution.costate[-1], gradient_.ravel(), atol=DERIVATIVE)


def test_the_costate_of_a_free_start_is_normal_to_its_manifold() -> None:
    solution = MultipleShooting(intervals=10, judged=False).build(everything()).run().or_raise()
    x, costate = solution.x[0], solution.costate[0]
    assert x[0] ** 2 + 2 * x[1] ** 2 == pytest.approx(0.5)
    tangent = np.array([-4 * x[1], 2 * x[0]])
    assert costate @ tangent == pytest.approx(0.0, abs=DERIVATIVE)


def test_costates_of_the_energy_problem() -> None:
    """Closed form in problems.energy; held controls converge to it with the interval squared."""
    errors = []
    for n in (10, 20):
        solution = MultipleShooting(intervals=n).build(energy()).run().or_raise()
        exact = np.column_stack([np.full(n + 1, -12.0), 12 * solution.t - 6])
        errors.append(np.abs(solution.costate - exact).max())
    assert errors[1] < errors[0] / 3.5
    assert errors[1] < 0.05
