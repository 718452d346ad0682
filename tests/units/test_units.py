"""The same problem in other units has the same answer: status, cost, states, effort."""

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import all_cases
from models import free_body_ocp
from models.shapes import Capsule, Cuboid
from models.textbook import goddard, van_der_pol
from ocp import OCP, Box, Constraint, Guess, Model, ProblemError, Solver, Status, evaluate, solve
from ocp.internal import MethodProgram
from ocp.problem.scaled import scaled, sizes_of
from solvers import (
    BetweenNodes,
    Collocation,
    IndirectShooting,
    LinearMPC,
    MultipleShooting,
    StagewiseNewton,
    diagnose,
    polish,
)
from solvers.constrained.between_nodes import BetweenNodesProgram
from solvers.internal import Cause
from tests.units.changed_units import Units

# Left out: where the minimum is so flat (fuller, beam: singular arcs) or the grid so coarse
# (hypersensitive, hanging chain, glider, shuttle) that the answer of the interior-point method at
# its tolerance differs in the sixth digit; and those whose iterations differ by more than half. Two
# have terms that ``Units`` does not pose: a rate, and ends that are coupled.
FLAT = {
    "beam", "fuller", "hypersensitive", "linear-hypersensitive", "hanging-chain", "turnpike",
    "pendulum-minimum-time", "cart-pole-swing-up", "two-link-arm-minimum-time",
    "exponential-minimum-time", "double-integrator-minimum-time", "overhead-crane",
    "periodic-algae", "shortest-turn", "hang-glider", "shuttle-reentry",
}  # fmt: skip
CASES = [c for c in all_cases() if c.suite == "library" and c.name not in FLAT]
QUICK = {"van-der-pol", "bryson-denham", "brachistochrone", "catalyst-mixing", "mass-tracking"}
SLOW = [pytest.mark.slow, pytest.mark.over_library]
SOLVERS: tuple[Solver, ...] = (MultipleShooting(40), Collocation(15))


def same_in_other_units(ocp: OCP, solver: Solver, seed: int) -> None:
    units = Units.drawn(ocp, seed)
    plain, other = solve(ocp, solver), solve(units.of(ocp), solver)
    again = units.back(other, ocp)
    assert again.status is plain.status, other.message
    assert again.cost == pytest.approx(plain.cost, rel=1e-6, abs=1e-9 * sizes_of(ocp).cost)
    assert abs(other.iterations - plain.iterations) <= 0.5 * plain.iterations + 2


@pytest.mark.parametrize("solver", SOLVERS, ids=["shooting", "collocation"])
@pytest.mark.parametrize(
    "case",
    [pytest.param(c, id=c.name, marks=[] if c.name in QUICK else SLOW) for c in CASES],
)
def test_direct_methods(case, solver) -> None:
    ocp = case.build()
    if isinstance(solver, Collocation) and ocp.model.is_discrete:
        pytest.skip("collocation takes no discrete-time model")
    if ocp.unknowns or ocp.peaks or ocp.data or ocp.model.nz or ocp.refers_to_start:
        pytest.skip("Units poses no constants, peaks, data, algebraic variables and coupled ends")
    same_in_other_units(ocp, solver, seed=sum(map(ord, case.name)))


@pytest.mark.parametrize("seed", range(3))
def test_newton(seed) -> None:
    same_in_other_units(van_der_pol(), StagewiseNewton(40), seed)


@pytest.mark.many
@pytest.mark.parametrize("seed", range(3))
def test_a_polished_answer(seed) -> None:
    ocp = van_der_pol()
    units = Units.drawn(ocp, seed)
    plain = polish(solve(ocp, MultipleShooting(40)))
    other = polish(solve(units.of(ocp), MultipleShooting(40)))
    assert other.status is plain.status is Status.SOLVED
    again = units.back(other, ocp)
    assert again.cost == pytest.approx(plain.cost, rel=1e-9)
    np.testing.assert_allclose(again.x, plain.x, atol=1e-7)
    np.testing.assert_allclose(again.costate, plain.costate, atol=1e-7)
    start = solve(units.of(ocp), MultipleShooting(40))
    shot = solve(units.of(ocp), IndirectShooting(segments=15), guess=start)
    assert units.back(shot, ocp).cost == pytest.approx(plain.cost, rel=1e-6)


def random_program(seed: int) -> OCP:
    """Linear, quadratic, bounded: a quadratic program of LinearMPC."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 4)), int(rng.integers(1, 3))
    x, u = ca.SX.sym("x", n), ca.SX.sym("u", m)
    a, b = np.eye(n) + 0.3 * rng.normal(size=(n, n)), rng.normal(size=(n, m))
    path = Constraint(
        "row", ca.DM(rng.normal(size=(1, n))) @ x + ca.DM(rng.normal(size=(1, m))) @ u, -9.0, 9.0
    )
    return OCP(
        name=f"random program {seed}",
        model=Model(name="linear", x=x, u=u, f=ca.DM(a) @ x + ca.DM(b) @ u, dt=0.1),
        x0=rng.normal(size=n),
        horizon=8,
        running_cost=ca.sumsqr(x) + 0.1 * ca.sumsqr(u),
        terminal_cost=ca.sumsqr(x),
        control_bounds=Box(-1.0, 1.0),
        constraints=(path,),
    )


@pytest.mark.many
@pytest.mark.parametrize("backend", ["osqp", "quadprog"])
@pytest.mark.parametrize("seed", range(25))
def test_linear_mpc(seed, backend) -> None:
    ocp = random_program(seed)
    units = Units.drawn(ocp, seed)
    plain, other = (
        solve(ocp, LinearMPC(backend=backend)),
        solve(units.of(ocp), LinearMPC(backend=backend)),
    )
    assert other.status is plain.status
    if plain.status.is_success:
        assert other.cost / units.cost == pytest.approx(plain.cost, rel=1e-6)
        np.testing.assert_allclose(other.u / units.u, plain.u, atol=1e-5)


def speed_limited(length: float = 1.0, cost: float = 1.0) -> OCP:
    """A cart with a limit of its speed; ``length`` and ``cost``: what 1 m and 1 are."""
    x, v, u = (ca.SX.sym(name) for name in "xvu")
    return OCP(
        name="cart",
        model=Model(
            name="cart",
            x=ca.vertcat(x, v),
            u=u,
            f=ca.vertcat(x + 0.1 * v, v + 0.1 * length * u),
            dt=0.1,
        ),
        x0=[3.0 * length, 0.0],
        horizon=15,
        running_cost=cost * (10.0 * (x / length) ** 2 + (v / length) ** 2 + 0.1 * u**2),
        control_bounds=Box(-2.0, 2.0),
        state_bounds=Box([-9.0 * length, -0.6 * length], [9.0 * length, 0.6 * length]),
    )


@pytest.mark.many
@pytest.mark.parametrize(("backend", "form"), [("osqp", "sparse"), ("daqp", "condensed")])
@pytest.mark.parametrize("length", [1e3, 1e6])
@pytest.mark.parametrize("price", [0.1, 10.0])
def test_the_price_of_a_soft_row_is_in_the_units_of_the_user(length, price, backend, form) -> None:
    """In sizes the answer is that of the problem as it is written."""
    solver = LinearMPC(soft=price / length**2, backend=backend, form=form)
    ocp, x0 = speed_limited(length), [3.0 * length, -1.2 * length]
    found = solver.build(ocp).run(x0=x0)
    written = solver.prepare(ocp).run(x0=x0)
    assert found.is_scaled
    assert found.status is Status.SOLVED
    assert found.cost == pytest.approx(written.cost, rel=1e-6)
    assert found.message == written.message
    excess = (np.abs(found.x[1:, 1]) - 0.6 * length).max()
    assert found.message.endswith(f"is exceeded by {excess:.3g}")


@pytest.mark.parametrize("cost", [1e7, 1e-7])
def test_the_price_of_a_soft_row_is_in_the_cost_of_the_user(cost) -> None:
    plain, other = (
        LinearMPC(soft=3.0 * c).build(speed_limited(cost=c)).run(x0=[3.0, -1.2])
        for c in (1.0, cost)
    )
    assert other.is_scaled
    assert other.cost / cost == pytest.approx(plain.cost, rel=1e-6)
    assert other.message == plain.message
    np.testing.assert_allclose(other.x, plain.x, atol=1e-5)


def test_the_least_violating_plan_has_one_price_for_all_rows_in_sizes() -> None:
    for length in (1.0, 1e3, 1e6):
        program = LinearMPC().least_violating(speed_limited(length))
        assert program is not None
        found = program.run(x0=[3.0 * length, -1.2 * length])
        assert found.status is Status.SOLVED
        assert found.cost == pytest.approx(937.9712727, rel=1e-6)
        assert found.message.endswith(f"is exceeded by {0.4 * length:.3g}")


def test_an_axis_in_pascal_moves() -> None:
    """1 mm, |p| <= 2 MPa: the same as a double integrator with |u| <= 2."""
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    force = 1e-9 * p
    axis = OCP(
        name="axis",
        model=Model(
            name="axis",
            x=x,
            u=p,
            f=ca.vertcat(x[0] + 0.1 * x[1] + 0.005 * force, x[1] + 0.1 * force),
            dt=0.1,
        ),
        x0=[1e-3, 0.0],
        horizon=20,
        running_cost=1e7 * x[0] ** 2 + 1e6 * x[1] ** 2 + 1e-13 * p**2,
        terminal_cost=1e7 * x[0] ** 2 + 1e6 * x[1] ** 2,
        control_bounds=Box(-2e6, 2e6),
    )
    for solver in (LinearMPC(), LinearMPC(form="condensed"), MultipleShooting()):
        solution = solve(axis, solver).or_raise()
        assert solution.u[0, 0] == pytest.approx(-2e6, rel=1e-6)
        assert evaluate(solution).cost == pytest.approx(72.3236677, rel=1e-6)


def test_messages_speak_in_the_units_of_the_user() -> None:
    """A door 1 km too far away for a cart that may go 1 m/s for 10 s, in micrometres."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    ocp = OCP(
        name="far",
        model=Model(name="cart", x=x, u=u, f=u),
        x0=0.0,
        horizon=10.0,
        running_cost=u**2,
        control_bounds=Box(-1e6, 1e6),
        constraints=(Constraint("door", x, 1e9, 1e9, at="terminal"),),
    )
    assert scaled(ocp) is not None
    solution = solve(ocp, MultipleShooting(10))
    assert solution.is_scaled
    assert solution.sizes.u.tolist() == pytest.approx([1e6], rel=10.0)
    assert solution.status is Status.INFEASIBLE
    assert "constraint 'door' is violated by 9.9e+08 at t = 10 s" in solution.message


def test_sizes_follow_the_units() -> None:
    for case in CASES[:12]:
        ocp = case.build()
        units, sizes = Units.drawn(ocp, 1), sizes_of(ocp)
        other = sizes_of(units.of(ocp))
        np.testing.assert_allclose(other.x, sizes.x * units.x, rtol=1e-6)
        np.testing.assert_allclose(other.u, sizes.u * units.u, rtol=1e-6)
        assert other.cost == pytest.approx(sizes.cost * units.cost, rel=1e-6)


def test_a_row_that_hardly_changes_is_measured_by_its_distance_from_the_bound() -> None:
    """Not by its slope of 1e-7, for which alone the whole problem would be scaled."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    model = Model(name="m", x=x, u=u, f=u)
    row = Constraint("clearance", ca.vertcat(x, 1e-7 * x + 0.5), lower=[-1.0, 0.1])
    ocp = OCP(
        name="m", model=model, x0=[1.0], horizon=1.0, running_cost=u**2 + x**2, constraints=(row,)
    )
    assert sizes_of(ocp).rows["clearance"][1] == pytest.approx(0.04, rel=1e-3)
    assert scaled(ocp) is None


def test_a_slope_that_stands_for_zero_is_no_size() -> None:
    # The distance of a body from a wall in front of it does not change to the side; its slope there
    # is some 1e-200, and made the lengths aside 1e86 m, in which every tolerance is met.
    wall = Cuboid([0.4, 2.0, 2.0]).at([0.0, 0.0, 1.0])
    rod = Capsule([-0.3, 0.0, 0.0], [0.3, 0.0, 0.0], 0.1)
    problem = free_body_ocp(
        (rod,), (wall,), start=[-2.0, 0.0, 1.0], goal=[2.0, 0.0, 1.0], horizon=4.0, margin=0.05
    )
    sizes = sizes_of(problem)
    of_rows = np.concatenate(list(sizes.rows.values()))
    assert np.concatenate([sizes.x, sizes.u, of_rows]).max() < 10.0


def test_a_method_around_a_method_chooses_the_sizes() -> None:
    """The tightened problem, whose rows have other sizes, is not scaled again."""
    ocp = goddard()
    assert scaled(ocp) is None
    program = BetweenNodes().build(ocp)
    assert isinstance(program, BetweenNodesProgram)
    assert isinstance(program.inner, MethodProgram)  # and nothing around it


def test_what_the_user_declares_is_the_size() -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    model = Model(name="m", x=x, u=u, f=ca.vertcat(x[1], u), x_nominal=[10.0, 0.1], u_nominal=3.0)
    end = Constraint("end", x, 0.0, 0.0, at="terminal", nominal=[5.0, 7.0])
    ocp = OCP(
        name="m", model=model, x0=[1.0, 0.0], horizon=1.0, running_cost=u**2, constraints=(end,)
    )
    sizes = sizes_of(ocp)
    assert (sizes.x.tolist(), sizes.u.tolist()) == ([10.0, 0.1], [3.0])
    assert sizes.rows["end"].tolist() == [5.0, 7.0]


@pytest.mark.parametrize("nominal", [0.0, -1.0, np.nan, np.inf, [1.0, 2.0, 3.0], "big"])
def test_nominal_sizes_are_positive_numbers(nominal) -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    with pytest.raises(ProblemError, match="model 'm': x_nominal"):
        Model(name="m", x=x, u=u, f=ca.vertcat(x[1], u), x_nominal=nominal)
    with pytest.raises(ProblemError, match="constraint 'c': nominal"):
        Constraint("c", x, 0.0, 0.0, at="terminal", nominal=nominal)


def transfer(metre: float, second: float) -> OCP:
    """The transfer of [Bryson & Ho 1975, 2.5] from the earth's orbit outwards, in given units."""
    unit, mu = 1.495978707e11, 1.32712440018e20  # [m], [m^3 / s^2]
    own = np.sqrt(unit**3 / mu)
    r, v_r, v_t, angle, t = (ca.SX.sym(name) for name in ("r", "v_r", "v_t", "angle", "t"))
    pull = mu * second**2 / metre**3
    push = 0.1405 * unit / own**2 * second**2 / metre / (1 - 0.07489 * t * second / own)
    rates = ca.vertcat(
        v_r,
        v_t**2 / r - pull / r**2 + push * ca.sin(angle),
        -v_r * v_t / r + push * ca.cos(angle),
    )
    around = ca.vertcat(v_r, v_t - ca.sqrt(pull / r))
    return OCP(
        name="transfer",
        model=Model(name="ship", x=ca.vertcat(r, v_r, v_t), u=angle, t=t, f=rates),
        x0=[unit / metre, 0.0, np.sqrt(pull * metre / unit)],
        horizon=3.3207 * own / second,
        terminal_cost=-r,
        constraints=(Constraint("circle", around, 0, 0, at="terminal"),),
        guess=Guess(u=np.linspace([0.5], [5.5], 50)),
    )


UNIT = 1.495978707e11
UNITS = [(UNIT, 5022642.891), (UNIT, 86400.0), (UNIT, 1.0), (1e9, 1.0), (1e3, 1.0), (1.0, 1.0)]


@pytest.mark.parametrize(("metre", "second"), UNITS)
def test_an_orbit_in_any_unit(metre: float, second: float) -> None:
    asked = transfer(metre, second)
    found = solve(asked, MultipleShooting(60))
    assert found.status.is_success, found.message
    assert found.x[-1, 0] * metre / UNIT == pytest.approx(1.52545, rel=1e-5)
    assert found.iterations < 30


@pytest.mark.slow
@pytest.mark.parametrize(("metre", "second"), UNITS)
def test_an_orbit_in_any_unit_is_diagnosed_as_solved(metre: float, second: float) -> None:
    findings = diagnose(transfer(metre, second)).findings
    assert Cause.UNSOLVED not in [finding.cause for finding in findings]


@pytest.mark.parametrize(("metre", "second"), UNITS)
def test_nominal_sizes_follow_the_units(metre: float, second: float) -> None:
    """The first round looked one unit away from the start, whatever that was."""
    one, other = (sizes_of(transfer(*units)) for units in (UNITS[0], (metre, second)))
    length, time = metre / UNITS[0][0], second / UNITS[0][1]
    scale = np.array([length, length / time, length / time])
    np.testing.assert_allclose(other.x * scale, one.x, rtol=1e-6)
    np.testing.assert_allclose(other.u, one.u, rtol=1e-6)


def test_a_row_with_margins_is_measured_as_before() -> None:
    """A motor that is weaker the faster it turns, in metres and in millimetres."""

    def motor(unit: float) -> OCP:
        x, v, u = (ca.SX.sym(name) for name in "xvu")
        return OCP(
            name="motor",
            model=Model(name="m", x=ca.vertcat(x, v), u=u, f=ca.vertcat(v, unit * u)),
            x0=[unit, 0.0],
            horizon=3.0,
            running_cost=(x / unit) ** 2 + 0.05 * u**2,
            control_bounds=Box(-3.0, 3.0),
            state_bounds=Box([-np.inf, -0.7 * unit], [np.inf, np.inf]),
            constraints=(Constraint("torque", u + v / unit, -1.0, 1.0),),
        )

    solver = BetweenNodes(MultipleShooting(15), tolerance=0.2)
    plain, other = solve(motor(1.0), solver), solve(motor(1e3), solver)
    assert plain.status is other.status is Status.SOLVED
    assert not plain.is_scaled
    assert other.is_scaled
    assert other.cost == pytest.approx(plain.cost, rel=1e-6)
