"""Direct multiple shooting takes everything that a description can say; both backends alike."""

from collections.abc import Callable
from typing import Literal

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.cases import arm_scenario
from models.textbook import (
    discrete_double_integrator,
    double_integrator_energy,
    double_integrator_minimum_time,
    van_der_pol,
)
from ocp import (
    OCP,
    RK4,
    Box,
    Constraint,
    Euler,
    FreeTime,
    Model,
    Parameter,
    ProblemError,
    Signal,
    Status,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import IndirectShooting, MultipleShooting, Schuetz
from tests.solvers.problems import (
    OTHER,
    TRANSFER_COST,
    TRANSFER_TIME,
    changed,
    circle_start,
    ends,
    mass,
    point,
    saturated_transfer,
    timed_transfer,
    tracker,
)
from tests.tolerances import CERTIFIED, DIRECT_COST, MINIMISER, SAME_PROGRAM

Backend = Literal["ipopt", "fatrop", "native"]
both = pytest.mark.parametrize("backend", ["ipopt", "fatrop", "native"])


def cornered() -> OCP:
    """State bounds, a path constraint with the control, a terminal inequality, all active."""
    model = mass()
    (x, v), u = ca.vertsplit(model.x), model.u
    return OCP(
        name="cornered",
        model=model,
        x0=[0.0, 0.0],
        horizon=2.0,
        running_cost=u**2 / 2,
        state_bounds=Box([-np.inf, -np.inf], [np.inf, 0.7]),
        constraints=(
            Constraint("power", v * u, upper=0.15),
            Constraint("far enough", x, lower=1.0, at="terminal"),
        ),
    )


PROBLEMS: dict[str, Callable[[], OCP]] = {
    "van der Pol": van_der_pol,
    "discrete time": lambda: discrete_double_integrator(20, 0.2),
    "time, parameters, signals": tracker,
    "control bounds": lambda: saturated_transfer()[0],
    "state, path, terminal inequality": cornered,
    "free time": timed_transfer,
    "minimum time": double_integrator_minimum_time,
    "manifold start": lambda: circle_start((0.9, 0.3)),
    "arm": lambda: arm_scenario("arm-002").ocp(),
    "arm, velocity form": lambda: arm_scenario("arm-002").ocp(form="velocity"),
    "arm, clearance": lambda: arm_scenario("arm-003").ocp(clearance=0.1),
}


@pytest.mark.many
@pytest.mark.parametrize("name", PROBLEMS)
def test_backends_agree(name: str) -> None:
    ocp = PROBLEMS[name]()
    one, other = (solve(ocp, MultipleShooting(40, backend=b)) for b in ("ipopt", "fatrop"))
    for solution in (one, other):
        assert solution.status is Status.SOLVED, solution.message
        assert np.all(ocp.control_bounds.excess(solution.u) == 0.0)
        assert np.all(ocp.state_bounds.excess(solution.x) == 0.0)
    # "minimum time" is found to the backends' tolerance on the constraints.
    assert one.cost == pytest.approx(other.cost, rel=SAME_PROGRAM)
    np.testing.assert_allclose(one.x, other.x, atol=1e-4)  # a minimum is flat: sqrt of the cost's
    size = 1.0 + np.abs(one.costate).max()
    np.testing.assert_allclose(one.costate, other.costate, atol=1e-3 * size)  # as above


# -- the kinds of problems ------------------------------------------------------------


@both
def test_discrete_time_is_the_riccati_recursion(backend: Backend) -> None:
    """J* = x0' P_0 x0 and the costates are 2 P_k x_k."""
    steps, dt = 30, 0.1
    a, b = np.array([[1.0, dt], [0.0, 1.0]]), np.array([[dt**2 / 2], [dt]])
    p = [np.eye(2)]
    for _ in range(steps):
        s = p[0]
        gain = np.linalg.solve(np.eye(1) + b.T @ s @ b, b.T @ s @ a)
        p.insert(0, np.eye(2) + a.T @ s @ (a - b @ gain))
    # The number of intervals is the problem's.
    solution = solve(discrete_double_integrator(steps, dt), MultipleShooting(7, backend=backend))
    x0 = np.array([1.0, 0.0])
    assert len(solution.u) == steps
    assert evaluate(solution).cost == pytest.approx(x0 @ p[0] @ x0, rel=CERTIFIED)
    expected = np.array([2.0 * s @ x for s, x in zip(p, solution.x, strict=True)])
    np.testing.assert_allclose(solution.costate, expected, atol=MINIMISER)


@both
def test_data_change_without_rebuilding(backend: Backend) -> None:
    """A run with other data equals a fresh problem that declares them."""
    program = MultipleShooting(30, backend=backend).build(tracker())
    first = program.run()
    x0, t0 = [-0.4, 0.6], 0.7
    again = program.run(parameters=OTHER, x0=x0, t0=t0)
    declared = tracker()
    entries = tuple(
        Signal(e.name, e.symbol, OTHER[e.name], hold=e.hold)
        if isinstance(e, Signal)
        else Parameter(e.name, e.symbol, OTHER[e.name])
        for e in declared.parameters
    )
    fresh = MultipleShooting(30, backend=backend).build(
        changed(declared, parameters=entries, x0=x0)
    )
    np.testing.assert_allclose(again.u, fresh.run(t0=t0).u, atol=CERTIFIED)
    assert (again.t[0], again.t[-1]) == (t0, t0 + 1.2)
    np.testing.assert_array_equal(again.x[0], x0)
    assert evaluate(again).cost == pytest.approx(again.cost, rel=1e-5)  # RK4 of 0.04 s
    # Nothing of it is left over in the next run.
    np.testing.assert_array_equal(program.run().u, first.u)


@both
def test_without_a_cost_the_constraints_are_all(backend: Backend) -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    ocp = OCP(
        name="no cost",
        model=Model(name="mass", x=x, u=u, f=u),
        x0=1.0,
        horizon=1.0,
        constraints=(Constraint("end", x, 0.0, 0.0, at="terminal"),),
    )
    solution = solve(ocp, MultipleShooting(10, backend=backend))
    assert solution.status is Status.SOLVED
    assert abs(solution.x[-1, 0]) <= 1e-6


@both
def test_free_final_time(backend: Backend) -> None:
    solution = solve(timed_transfer(), MultipleShooting(100, backend=backend))
    assert solution.duration == pytest.approx(TRANSFER_TIME, rel=DIRECT_COST)
    assert evaluate(solution).cost == pytest.approx(TRANSFER_COST, rel=DIRECT_COST)


@both
def test_final_time_within_its_bounds(backend: Backend) -> None:
    ocp = timed_transfer(horizon=FreeTime(guess=1.0, lower=0.5, upper=1.5))
    solution = solve(ocp, MultipleShooting(40, backend=backend))
    assert solution.status is Status.SOLVED
    assert solution.duration <= 1.5
    # T + 6/T^3 at T = 3/2.
    assert evaluate(solution).cost == pytest.approx(1.5 + 6.0 / 1.5**3, rel=1e-3)


@both
def test_manifold_start(backend: Backend) -> None:
    solution = solve(circle_start((0.5, 0.9)), MultipleShooting(20, backend=backend))
    np.testing.assert_allclose(solution.x[0], [1.0, 0.0], atol=MINIMISER)
    assert evaluate(solution).cost == pytest.approx(0.25, rel=CERTIFIED)
    # The costate at the start is normal to the circle, and dJ*/dx = -(distance)/2.
    np.testing.assert_allclose(solution.costate[0], [-0.5, 0.0], atol=MINIMISER)


def test_initial_inequality() -> None:
    """Start at most 1 away from 0, end at 3: from 1, with u = 2 all the way."""
    ocp = point(
        constraints=lambda x, u: (
            Constraint("gate", x, -1.0, 1.0, at="initial"),
            *ends(3.0)(x, u),
        )
    )
    solution = solve(ocp, MultipleShooting(10))
    assert evaluate(solution).cost == pytest.approx(4.0, rel=MINIMISER)
    np.testing.assert_allclose(solution.u, 2.0, rtol=MINIMISER)
    with pytest.raises(UnsupportedProblem, match="fatrop takes no inequality at the start"):
        MultipleShooting(10, backend="fatrop").build(ocp)


@both
def test_all_constraints_are_met_and_active(backend: Backend) -> None:
    solution = solve(cornered(), MultipleShooting(50, backend=backend))
    x, u = solution.x, solution.u
    assert x[:, 1].max() == pytest.approx(0.7, abs=MINIMISER)
    assert (x[:-1, 1] * u[:, 0]).max() == pytest.approx(0.15, abs=MINIMISER)
    assert x[-1, 0] == pytest.approx(1.0, abs=MINIMISER)
    # Between the nodes a held control lets v go on growing: power by u^2 h.
    assert evaluate(solution).violation <= (u**2).max() * 2.0 / 50


@pytest.mark.many
@both
@pytest.mark.parametrize("limit", [1.0, 30.0])
def test_controls_never_leave_their_bounds(backend: Backend, limit: float) -> None:
    ocp = changed(double_integrator_minimum_time(), control_bounds=Box(-limit, limit))
    for intervals in (15, 40, 75):
        solution = solve(ocp, MultipleShooting(intervals, backend=backend))
        assert solution.status is Status.SOLVED
        assert np.abs(solution.u).max() <= limit


def test_coarse_integrators_of_any_order() -> None:
    """The costs of RK4, Euler with many substeps and the referee approach each other."""
    costs = [
        evaluate(solve(van_der_pol(), MultipleShooting(50, integrator=i))).cost
        for i in (RK4(), Euler(steps=20))
    ]
    assert costs[0] == pytest.approx(costs[1], rel=DIRECT_COST)


# -- starts ---------------------------------------------------------------------------


@pytest.mark.many
@both
def test_any_solution_starts_it(backend: Backend) -> None:
    ocp = van_der_pol()
    program = MultipleShooting(50, backend=backend).build(ocp)
    cold = program.run()
    for solver in (Schuetz.sound(intervals=30), IndirectShooting(), MultipleShooting(20)):
        warm = program.run(guess=solve(ocp, solver))
        assert warm.status is Status.SOLVED
        assert warm.cost == pytest.approx(cold.cost, rel=CERTIFIED)
        assert warm.iterations <= cold.iterations


def test_a_guess_chooses_the_basin() -> None:
    ocp = arm_scenario("arm-003").ocp()
    program = MultipleShooting(40).build(ocp)
    low = program.run(guess=solve(ocp, Schuetz.sound()))
    assert low.cost == pytest.approx(2.369, rel=1e-3)  # 40 intervals


@both
def test_a_maximum_is_left(backend: Backend) -> None:
    """u = 0 is stationary, but J = x1^2 - 3 x1^2 + x1^4 is least at x1 = 1 or -1, with -1."""
    ocp = point(terminal_cost=lambda x, u: -3.0 * x**2 + x**4)
    solution = solve(ocp, MultipleShooting(20, backend=backend))
    assert solution.status is Status.SOLVED
    assert abs(solution.x[-1, 0]) == pytest.approx(1.0, abs=MINIMISER)
    assert evaluate(solution).cost == pytest.approx(-1.0, rel=CERTIFIED)


@pytest.mark.many
@both
def test_deterministic(backend: Backend) -> None:
    ocp = arm_scenario("arm-002").ocp()
    one, other = (solve(ocp, MultipleShooting(30, backend=backend)) for _ in range(2))
    np.testing.assert_array_equal(one.x, other.x)
    np.testing.assert_array_equal(one.u, other.u)
    np.testing.assert_array_equal(one.costate, other.costate)
    assert (one.cost, one.iterations, one.work) == (other.cost, other.iterations, other.work)


@pytest.mark.slow
@given(st.integers(1, 12), st.sampled_from([van_der_pol, double_integrator_energy, tracker]))
@settings(max_examples=12, deadline=None)
def test_any_number_of_intervals(intervals: int, make: Callable[[], OCP]) -> None:
    solution = solve(make(), MultipleShooting(intervals, integrator=RK4(steps=4), accuracy=1e9))
    assert solution.u.shape == (intervals, 1)
    # Two terminal equations need two controls.
    if make is not double_integrator_energy or intervals > 1:
        assert solution.status is Status.SOLVED


@pytest.mark.parametrize(
    "make",
    [
        lambda: MultipleShooting(0),
        lambda: MultipleShooting(backend="snopt"),  # pyright: ignore[reportArgumentType]
        lambda: MultipleShooting(tolerance=0.0),
        lambda: MultipleShooting(accuracy=np.nan),
        lambda: MultipleShooting(max_iterations=0),
    ],
)
def test_bad_options(make: Callable[[], object]) -> None:
    with pytest.raises(ProblemError):
        make()
