"""Failure is a value: a status that names what and when, finite arrays, and not a word printed."""

import re
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from models.textbook import van_der_pol
from ocp import (
    OCP,
    Box,
    Constraint,
    Guess,
    Model,
    ProblemError,
    Solution,
    Solver,
    Status,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import (
    Armijo,
    Collocation,
    FixedStep,
    HorizonContinuation,
    IndirectShooting,
    MultipleShooting,
    Schuetz,
    StagewiseNewton,
)
from tests.solvers.problems import changed, ends, mass, moving, point, tracker

SHOOTING = tuple(MultipleShooting(20, backend=b) for b in ("ipopt", "fatrop", "native"))
DIRECT = (*SHOOTING, Collocation(10, 3), Collocation(10, 3, points="gauss"))
ALL = (
    *DIRECT,
    StagewiseNewton(20),
    IndirectShooting(),
    IndirectShooting(damped=False),
    IndirectShooting(segments=5, steps=50, jacobian="finite-difference"),
    IndirectShooting(steps=100, continuation=HorizonContinuation()),
    Schuetz(),
    Schuetz.sound(),
    Schuetz(step=FixedStep(1e3), stop_on_rise=False),
    Schuetz(gradient="discrete", step=Armijo(most=2)),
)
direct = pytest.mark.parametrize(
    "solver", DIRECT, ids=lambda s: getattr(s, "backend", "") or s.points
)
every = pytest.mark.parametrize("solver", ALL, ids=repr)


@pytest.fixture(autouse=True)
def _silent(capfd: pytest.CaptureFixture[str]):
    """No solver prints anything, in the C++ below it either."""
    yield
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


def stands_behind_nothing(solution: Solution) -> None:
    assert not solution.status.is_success
    for array in (solution.t, solution.x, solution.u, solution.costate):
        assert np.isfinite(array).all()


# -- bad data -------------------------------------------------------------------------

BAD_DATA: tuple[dict[str, Any], ...] = (
    {"x0": [1.0, 2.0, 3.0]},
    {"x0": [np.nan, 0.0]},
    {"t0": np.inf},
    {"parameters": {"weight": 1.0}},
    {"parameters": {"gain": np.nan}},
    # An indirect method reads the states of a guess, descent its controls, a direct method both.
    {"guess": Guess(x=[1.0, 2.0, 3.0], u=[1.0, 2.0])},
    {"guess": Guess(x=[np.nan, 0.0], u=[np.nan])},
)


@every
def test_bad_data_are_refused(solver: Solver) -> None:
    program = solver.build(tracker())
    for data in BAD_DATA:
        with pytest.raises(ProblemError):
            program.run(**data)


# -- infeasible -----------------------------------------------------------------------


def braked() -> OCP:
    """3 m/s towards a wall 1 m away, with brakes of 1 m/s^2: it takes 4.5 m to stop."""
    model = mass()
    return OCP(
        name="braked",
        model=model,
        x0=[0.0, 3.0],
        horizon=1.0,
        running_cost=model.u**2,
        control_bounds=Box(-1.0, 1.0),
        state_bounds=Box([-np.inf, -np.inf], [1.0, np.inf]),
    )


INFEASIBLE: dict[str, tuple[Callable[[], OCP], str, float]] = {
    # The name of the constraint and when it is violated.
    "unreachable end": (
        lambda: point(control_bounds=Box(-1, 1), constraints=ends(2.0)),
        "end",
        1.0,
    ),
    "contradictory ends": (
        lambda: point(
            constraints=lambda x, u: (
                *ends(2.0)(x, u),
                Constraint("other", x, upper=1.0, at="terminal"),
            )
        ),
        "end|other",
        1.0,
    ),
    "state bound against the dynamics": (braked, "bound of x_0", 1.0),
    "x0 violates a path constraint": (
        lambda: point(constraints=lambda x, u: (Constraint("wall", x, lower=1.0),)),
        "wall",
        0.0,
    ),
    "x0 is caught behind a path constraint": (
        lambda: point(
            control_bounds=Box(-1, 1), constraints=lambda x, u: (Constraint("wall", x, lower=1.5),)
        ),
        "wall",
        0.05,
    ),
    "path constraint on the control": (
        lambda: point(
            control_bounds=Box(-0.4, 0.4),
            constraints=lambda x, u: (Constraint("push", x + u, lower=1.0),),
        ),
        "push",
        0.0,
    ),
}


@pytest.mark.many
@direct
@pytest.mark.parametrize("name", INFEASIBLE)
def test_infeasible_names_constraint_and_time(name: str, solver: Solver) -> None:
    make, constraint, when = INFEASIBLE[name]
    solution = solve(make(), solver)
    assert solution.status is Status.INFEASIBLE
    match = re.fullmatch(
        r"(?:[a-z ]*constraint )?'?([^']*)'? is violated by (\S+) at t = (\S+) s"
        r"(, by the given start itself)?",
        solution.message,
    )
    assert match, solution.message
    assert re.fullmatch(constraint, match[1])
    assert float(match[2]) > 0.1
    assert float(match[3]) == pytest.approx(when, abs=0.051)
    assert bool(match[4]) == name.startswith("x0 violates")
    stands_behind_nothing(solution)


def test_without_rescue_a_failure_is_what_the_backend_says() -> None:
    make, *_ = INFEASIBLE["unreachable end"]
    quick = solve(make(), MultipleShooting(20, feasibility_restoration=False))
    assert quick.status is Status.FAILED
    assert "a point where the constraints' violation is least, not zero" in quick.message
    thorough = solve(make(), MultipleShooting(20))
    assert thorough.status is Status.INFEASIBLE
    assert quick.iterations < thorough.iterations


@direct
def test_a_start_outside_its_bounds_is_named_and_the_rest_is_optimal(solver: Solver) -> None:
    """A start that is given is no unknown: from the first step on the answer is an optimum.

    It lies so little outside that it is back within 5 ms, before any method's second instant.
    """
    ocp = point(control_bounds=Box(-2.0, 2.0), state_bounds=Box(-0.2, 0.2))
    program = solver.build(ocp)
    outside = program.run(x0=[0.21])
    assert outside.status is Status.INFEASIBLE
    assert outside.message == "bound of x is violated by 0.01 at t = 0 s, by the given start itself"
    assert ocp.state_bounds.excess(outside.x[1:]).max() < 1e-8
    verdict = evaluate(outside)
    assert verdict.violation == pytest.approx(0.01)
    assert verdict.worst == "bound of x at t = 0 s"
    assert program.run(x0=[0.2]).status is Status.SOLVED


def test_more_terminal_equations_than_states() -> None:
    """fatrop would abort with an assertion; IPOPT says that there is no solution."""
    ocp = point(constraints=lambda x, u: (*ends(1.0)(x, u), *ends(2.0, "other")(x, u)))
    with pytest.raises(UnsupportedProblem, match=r"2 equations for 1 unknowns .* 'other'"):
        DIRECT[1].build(ocp)
    assert solve(ocp, DIRECT[0]).status is Status.INFEASIBLE


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["ipopt", "fatrop", "native"])
def test_arm_034_cannot_keep_clear(backend) -> None:
    """The path of the end effector itself passes 0.106 m from the centre."""
    scenario = arm_scenario("arm-034")
    solution = solve(scenario.ocp(clearance=0.2), MultipleShooting(75, backend=backend))
    assert solution.status is Status.INFEASIBLE
    match = re.fullmatch(
        r"constraint 'clearance' is violated by (\S+) at t = (\S+) s", solution.message
    )
    assert match, solution.message
    # The best that can be done is the path's own distance.
    assert float(match[1]) == pytest.approx(0.2 - scenario.path_clearance, abs=2e-3)
    assert evaluate(solution).violation > 0.05


# -- inaccurate, limited, unbounded ---------------------------------------------------


@direct
def test_a_coarse_integrator_is_inaccurate(solver: Solver) -> None:
    """RK4 with h = 1/20 is unstable on dx/dt = -100 x: without control it ends at 5e22."""
    solution = solve(moving(lambda x, u: -100 * x + u, x0=1.0), solver)
    assert solution.status is Status.INACCURATE
    assert re.fullmatch(r"a state moves by \S+ at t = \S+ s(; by IPOPT.*)?", solution.message)


@pytest.mark.parametrize("backend", ["ipopt", "fatrop", "native"])
def test_iteration_limit_of_direct_methods(backend) -> None:
    solution = solve(
        arm_scenario("arm-001").ocp(), MultipleShooting(30, backend=backend, max_iterations=2)
    )
    assert solution.status is Status.ITERATION_LIMIT
    stands_behind_nothing(solution)


def test_iteration_limit_of_shooting() -> None:
    solution = solve(van_der_pol(), IndirectShooting(max_steps=2))
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.iterations == 2
    assert re.fullmatch(r"residual \S+ after 2 Newton steps", solution.message)


@pytest.mark.many
@direct
@pytest.mark.parametrize(
    "terms",
    [
        {"running_cost": lambda x, u: -(u**2)},
        {"running_cost": lambda x, u: u**2 - 10 * x**2},
        {"running_cost": lambda x, u: x},
        {"running_cost": lambda x, u: u},
        {"terminal_cost": lambda x, u: -3 * x**2},
    ],
    ids=["-u^2", "u^2 - 10 x^2", "x", "u", "-3 x(1)^2"],
)
def test_a_cost_without_lower_bound_is_no_success(terms: dict, solver: Solver) -> None:
    """The conjugate point of u^2 - 10 x^2 lies in the horizon; u = 0 is stationary in three."""
    stands_behind_nothing(solve(point(**terms), solver))


@pytest.mark.parametrize(
    "solver", [Schuetz.sound(), Schuetz(step=FixedStep(0.5))], ids=["sound", "fixed"]
)
def test_descent_without_end_is_no_success(solver: Solver) -> None:
    stands_behind_nothing(solve(point(running_cost=lambda x, u: u + x), solver))


# -- NaN ------------------------------------------------------------------------------

UNDEFINED = {
    "dynamics": lambda: moving(lambda x, u: -1 - ca.sqrt(x) + 0 * u, x0=0.5),
    "dynamics with the control": lambda: moving(lambda x, u: -2 + u * ca.sqrt(x), x0=0.5),
    "cost": lambda: moving(lambda x, u: u - 3, x0=0.5, running_cost=lambda x, u: ca.log(x) + u**2),
    "blow-up": lambda: moving(lambda x, u: x**3 + u, x0=2.0),
}


@pytest.mark.many
@every
@pytest.mark.parametrize("name", UNDEFINED)
def test_nan_away_from_the_start(name: str, solver: Solver) -> None:
    ocp = UNDEFINED[name]()
    try:
        program = solver.build(ocp)
    except UnsupportedProblem:
        pytest.skip("the Hamiltonian is singular: no matter for an indirect method")
    solution = program.run()
    for array in (solution.t, solution.x, solution.u, solution.costate):
        assert np.isfinite(array).all()
    if solution.status.is_success:  # the blow-up can be averted
        assert np.isfinite(evaluate(solution).cost)
        assert name == "blow-up"


@pytest.mark.many
@every
def test_a_bad_guess_is_survived(solver: Solver) -> None:
    guess = Guess(x=[1e3, -1e3], u=[1e4], costate=[1e6, -1e6])
    solution = solve(van_der_pol(), solver, guess=guess)
    assert np.isfinite(solution.x).all()
    if solution.status.is_success:
        assert evaluate(solution).cost < 1.1


@pytest.mark.many
@every
def test_success_is_silent_too(solver: Solver) -> None:
    solution = solve(changed(van_der_pol(), horizon=1.0), solver)
    assert np.isfinite(solution.x).all()


@pytest.mark.many
@pytest.mark.parametrize(
    "solver",
    [*(MultipleShooting(40, backend=b) for b in ("ipopt", "fatrop", "native")), Collocation(20)],
)
def test_a_cost_that_is_tiny_at_the_start_hides_no_way(solver) -> None:
    """Beyond a hill the size of the cost is a million times larger: the end was INFEASIBLE."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 2)
    hill = OCP(
        name="hill",
        model=Model(name="integrator", x=x, u=u, f=u),
        x0=[-1.0, 0.0],
        horizon=1.0,
        running_cost=ca.sumsqr(u) + 30 * ca.exp(-10 * ca.sumsqr(x)),
        constraints=(Constraint("end", x, [1.0, 0.0], [1.0, 0.0], at="terminal"),),
    )
    found = solve(hill, solver)
    assert found.status.is_success, found.message
    assert found.cost == pytest.approx(6.013, rel=1e-3)
