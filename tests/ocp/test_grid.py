"""Grids of unequal intervals, and controls held over several of them."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ocp import (
    MPC,
    OCP,
    RK4,
    Box,
    Constraint,
    FreeTime,
    Grid,
    Model,
    Plant,
    ProblemError,
    Soft,
    UnsupportedProblem,
    evaluate,
    solve,
)
from ocp.internal import ControlBlocks
from solvers import (
    BetweenNodes,
    Collocation,
    IndirectShooting,
    LinearMPC,
    MultipleShooting,
    Schuetz,
    StagewiseNewton,
    polish,
)

X, U = ca.SX.sym("x", 2), ca.SX.sym("u")
VDP = Model(name="vdp", x=X, u=U, f=ca.vertcat(X[1], (1 - X[0] ** 2) * X[1] - X[0] + U))
GROWING = Grid.geometric(12, 1.25)
BLOCKS = (1, 1, 2, 4, 2)


def vdp(**changes) -> OCP:
    given = {
        "name": "vdp",
        "model": VDP,
        "x0": [1.0, 0.0],
        "horizon": 2.0,
        "running_cost": ca.sumsqr(X) / 2 + U**2 / 2,
        "terminal_cost": ca.sumsqr(X),
    }
    return OCP(**(given | changes))


CONSTRAINED = {
    "terminal_cost": 0.0,
    "control_bounds": Box(-0.8, 0.8),
    "constraints": (
        Constraint("end", X[0], 0.3, 0.3, at="terminal"),
        Constraint("floor", X[1] + 0.1 * U, -0.8),
    ),
}


def by_hand(grid: Grid, lengths: tuple[int, ...]) -> tuple[float, np.ndarray]:
    """The constrained problem in CasADi's Opti, one variable a block: cost and controls."""
    opti, nodes = ca.Opti(), 2.0 * np.asarray(grid.fractions)
    moves = np.repeat(np.arange(len(lengths)), lengths)
    moves = np.append(moves, np.full(grid.intervals - len(moves), len(lengths) - 1))
    u, x, cost = opti.variable(len(lengths)), ca.DM([1.0, 0.0]), 0
    z = ca.vertcat(X, ca.SX.sym("cost"))
    rate = ca.Function("rate", [z, U], [ca.vertcat(VDP.f, ca.sumsqr(X) / 2 + U**2 / 2)])
    opti.subject_to(opti.bounded(-0.8, u, 0.8))
    for k, width in enumerate(np.diff(nodes)):
        now, move = ca.vertcat(x, cost), u[int(moves[k])]
        opti.subject_to(x[1] + 0.1 * move >= -0.8)
        k1 = rate(now, move)
        k2 = rate(now + width / 2 * k1, move)
        k3 = rate(now + width / 2 * k2, move)
        after = now + width / 6 * (k1 + 2 * k2 + 2 * k3 + rate(now + width * k3, move))
        x, cost = after[:2], after[2]
    opti.subject_to(x[0] == 0.3)
    opti.minimize(cost)
    opti.set_initial(u, 0.5)
    quiet = {"print_time": False}
    opti.solver("ipopt", quiet, {"print_level": 0, "sb": "yes", "tol": 1e-12})
    found = opti.solve()
    return float(found.value(cost)), np.array(found.value(u)).ravel()[moves]


@pytest.mark.many
@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
@pytest.mark.parametrize("blocks", [(), BLOCKS, (1, 1, 2), (3,)])
def test_grid_and_blocks_give_the_optimum_of_a_program_by_hand(backend, blocks):
    cost, u = by_hand(GROWING, blocks or (1,) * 12)
    solver = MultipleShooting(GROWING, backend=backend, blocks=blocks, tolerance=1e-11)
    found = solve(vdp(**CONSTRAINED), solver).or_raise()
    assert found.cost == pytest.approx(cost, rel=1e-10)
    np.testing.assert_allclose(found.u.ravel(), u, atol=1e-6)
    np.testing.assert_allclose(found.fractions, GROWING.fractions, atol=1e-15)
    if blocks:
        assert len(np.unique(found.u)) == len(blocks)
    assert evaluate(found).cost == pytest.approx(found.cost, rel=1e-4)


@pytest.mark.many
@pytest.mark.parametrize(
    "make",
    [
        MultipleShooting,
        StagewiseNewton,
        lambda n: Schuetz.sound(intervals=n),
        Collocation,
        lambda n: IndirectShooting(segments=4, steps=n),
    ],
    ids=["MultipleShooting", "StagewiseNewton", "Schuetz", "Collocation", "IndirectShooting"],
)
def test_equal_intervals_are_a_number_of_them_and_unequal_ones_the_same_optimum(make):
    numbered, equal, unequal = (
        solve(vdp(), make(n)).or_raise() for n in (40, Grid.uniform(40), Grid.geometric(40, 1.03))
    )
    assert equal.cost == pytest.approx(numbered.cost, rel=1e-12)
    assert np.ptp(np.diff(unequal.fractions)) > 0.01 / 40
    assert unequal.cost == pytest.approx(numbered.cost, rel=1e-3)
    np.testing.assert_allclose(unequal.costate[0], numbered.costate[0], rtol=2e-2)


def test_costates_of_blocked_controls_are_slopes_of_the_optimal_cost():
    program, step = MultipleShooting(GROWING, blocks=BLOCKS, tolerance=1e-11).build(vdp()), 1e-4
    for i in range(2):
        low, high = (
            program.run(x0=np.array([1.0, 0.0]) + sign * step * np.eye(2)[i]).cost
            for sign in (-1, 1)
        )
        slope = program.run().costate[0, i]
        assert slope == pytest.approx((high - low) / (2 * step), rel=1e-6)


def test_gradients_and_programs_agree_on_blocks():
    direct = solve(vdp(), MultipleShooting(GROWING, blocks=BLOCKS)).or_raise()
    sound = Schuetz.sound(intervals=GROWING)
    blocked = Schuetz(**{**vars(sound), "blocks": BLOCKS, "stationarity": 1e-7})
    found = solve(vdp(), blocked)
    assert found.status.is_success
    assert found.cost == pytest.approx(direct.cost, rel=1e-9)
    assert len(np.unique(found.u)) == len(BLOCKS)


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_a_free_final_time_and_an_equation_of_controls_take_blocks(backend):
    two = ca.SX.sym("w", 2)
    model = Model(name="mass", x=X, u=two, f=ca.vertcat(X[1], two[0] - two[1]))
    ocp = OCP(
        name="in time",
        model=model,
        x0=[0, 0],
        horizon=FreeTime(2.0),
        running_cost=1.0,
        control_bounds=Box(-1, 1),
        constraints=(
            Constraint("there", X, [1, 0], [1, 0], at="terminal"),
            Constraint("shared", two[0] + two[1], 0.0, 0.0),
        ),
    )
    found = solve(ocp, MultipleShooting(8, backend=backend, blocks=(4, 4))).or_raise()
    assert found.duration == pytest.approx(np.sqrt(2.0), rel=1e-6)
    assert len(np.unique(found.u[:, 0])) == 2


def test_slacks_are_not_held_in_blocks():
    """A slack held with its controls would pay over the whole block for its worst instant."""
    slow = Constraint("slow", X[1], -0.3, soft=Soft(linear=1.0))
    ocp = vdp(constraints=(slow,))
    found = solve(ocp, MultipleShooting(20, blocks=(20,))).or_raise()
    excess = found.slack["slow"]
    assert len(np.unique(found.u)) == 1
    assert excess.max() > 0.1 > 1e-6 > excess.min()
    assert found.cost == pytest.approx(evaluate(found).cost, rel=2e-2)


# -- in discrete time ---------------------------------------------------------------------------

STEP = Model(name="steps", x=X, u=U, dt=0.1, f=ca.vertcat(X[0] + 0.1 * X[1], X[1] + 0.1 * U))


def steps(**changes) -> OCP:
    return vdp(
        model=STEP, horizon=20, control_bounds=Box(-0.8, 0.8), state_bounds=Box(-0.5, 2), **changes
    )


@pytest.mark.parametrize("form", ["sparse", "condensed"])
def test_a_control_horizon_of_a_quadratic_program(form):
    blocks = (1, 1, 3)
    direct = solve(steps(), MultipleShooting(blocks=blocks, tolerance=1e-11)).or_raise()
    found = solve(steps(), LinearMPC(form=form, blocks=blocks)).or_raise()
    assert found.cost == pytest.approx(direct.cost, rel=1e-7)
    np.testing.assert_allclose(found.u, direct.u, atol=1e-5)
    np.testing.assert_allclose(found.costate, direct.costate, atol=1e-4)
    free = solve(steps(), LinearMPC(form=form)).or_raise()
    assert free.cost < found.cost - 1e-3


def test_a_discrete_model_has_a_grid_of_its_own():
    with pytest.raises(UnsupportedProblem, match="takes no Grid; blocks hold"):
        solve(steps(), MultipleShooting(GROWING))


# -- around it ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_loop_plans_on_a_grid_that_grows():
    ocp = vdp(control_bounds=Box(-1, 1), horizon=4.0)
    grid = Grid.of_times([0, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 1.8, 2.6, 4.0])
    fine, costs = RK4(6), []  # the last interval is 14 times the first
    solvers = [MultipleShooting(40), MultipleShooting(grid, fine)]
    for solver in (*solvers, MultipleShooting(grid, fine, blocks=(1, 1, 1, 1, 1, 2))):
        loop = MPC(ocp=ocp, solver=solver, dt=0.1, compiled=False)
        costs.append(loop.run(Plant(ocp=ocp), x0=[1, 0], duration=1.5).cost)
        assert loop.state.plan is not None
        assert len(loop.state.plan.u) == (40 if solver.intervals == 40 else 9)
    assert costs[1] == pytest.approx(costs[0], rel=2e-2)
    assert costs[2] == pytest.approx(costs[0], rel=5e-2)


def test_the_rest_of_a_plan_is_its_own_intervals():
    """From an instant between two nodes on, the model runs from there to the plan's next node."""
    ocp = vdp(control_bounds=Box(-1, 1), state_bounds=Box(-5, 5), horizon=4.0)
    solver = MultipleShooting(Grid.of_times([0, 0.1, 0.2, 1.0, 2.0, 4.0]), integrator=RK4(10))
    loop = MPC(ocp=ocp, solver=solver, dt=0.1, compiled=False)
    loop.step([1.0, 0.0], 0.0)
    plan = loop.state.plan
    assert plan is not None
    state = plan.x[1] + (0.0, 1e-3)
    late = loop.step(state, 0.1, late=True)
    assert late.input[0] == pytest.approx(plan.u[1, 0])


def test_polish_takes_a_grid():
    solver = IndirectShooting(segments=5, steps=Grid.geometric(40, 1.05))
    polished = polish(solve(vdp(), MultipleShooting(20)), solver=solver).or_raise()
    assert polished.cost == pytest.approx(solve(vdp(), Collocation(20)).cost, rel=1e-8)


@pytest.mark.parametrize("inner", [MultipleShooting(GROWING), MultipleShooting(20, blocks=(1, 2))])
def test_what_halves_equal_intervals_refuses_others(inner):
    with pytest.raises(UnsupportedProblem, match="no Grid and no blocks"):
        BetweenNodes(inner)


# -- bad input ----------------------------------------------------------------------------------


@given(st.lists(st.floats(-1.0, 2.0) | st.just(float("nan")), max_size=6))
def test_nodes_increase_from_0_to_1_or_are_refused(fractions):
    sound = len(fractions) > 1 and fractions[0] == 0.0 and fractions[-1] == 1.0
    if sound and (np.diff(fractions) > 1e-9).all():
        assert Grid(fractions).intervals == len(fractions) - 1
    else:
        with pytest.raises(ProblemError, match=r"^grid: "):
            Grid(fractions)


@given(
    st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=9, unique_by=lambda t: round(t, 3)),
    st.integers(1, 4),
)
def test_instants_become_fractions(times, parts):
    times = np.sort(times)
    grid = Grid.of_times(times)
    back = times[0] + np.asarray(grid.fractions) * np.ptp(times)
    np.testing.assert_allclose(back, times, atol=1e-9)
    fine = grid.cut(parts)
    np.testing.assert_allclose(fine.fractions[::parts], grid.fractions, atol=1e-12)
    assert grid.with_nodes(grid.fractions) == grid
    assert (
        1 / np.pi in grid.with_nodes([1 / np.pi]).fractions
        or np.abs(np.asarray(grid.fractions) - 1 / np.pi).min() <= 1e-9
    )


@given(st.integers(1, 60), st.floats(0.8, 1.25))
def test_each_interval_is_so_many_times_the_one_before(intervals, ratio):
    widths = np.diff(Grid.geometric(intervals, ratio).fractions)
    np.testing.assert_allclose(widths[1:] / widths[:-1], ratio, rtol=1e-5)


@pytest.mark.parametrize("ratio", [0.0, -1.0, np.nan, np.inf, True, "2", 1e6])
def test_ratios_that_are_none(ratio):
    with pytest.raises(ProblemError, match=r"^grid: "):
        Grid.geometric(10, ratio)


@given(st.lists(st.integers(1, 9), max_size=6), st.integers(1, 30))
def test_blocks_fill_a_grid_or_are_refused(lengths, intervals):
    if sum(lengths) > intervals:
        with pytest.raises(ProblemError, match="intervals long, the grid has"):
            ControlBlocks.of(lengths, intervals, [0], "here")
        return
    blocks = ControlBlocks.of(lengths, intervals, [0], "here")
    if not lengths:
        assert blocks is None
        return
    assert blocks is not None
    counts = np.unique(blocks.leaders, return_counts=True)[1]
    assert counts.sum() == intervals
    assert counts[:-1].tolist() == lengths[:-1]


@pytest.mark.parametrize("blocks", [(0,), (1.0,), (True,), ("1",), 3, "12", (-1, 2)])
def test_lengths_that_are_none(blocks):
    with pytest.raises(ProblemError, match="block"):
        MultipleShooting(10, blocks=blocks)


def test_blocks_that_are_too_long_are_refused_at_build():
    with pytest.raises(ProblemError, match=r"vdp: MultipleShooting: blocks = .* the grid has 12"):
        MultipleShooting(GROWING, blocks=(6, 7)).build(vdp())


@pytest.mark.parametrize("intervals", [(0.0, 1.0), 0, 2.5, None, np.linspace(0, 1, 5)])
def test_what_is_neither_a_number_nor_a_grid(intervals):
    with pytest.raises(ProblemError, match="intervals"):
        MultipleShooting(intervals)
