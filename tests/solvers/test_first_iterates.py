"""First iterates of direct methods: tame roll-outs, other durations, starts without a slope."""

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from ocp import (
    OCP,
    RK4,
    Box,
    Constraint,
    FreeTime,
    Guess,
    Model,
    ProblemError,
    Solver,
    Status,
    solve,
)
from ocp.internal import RunData, Transcription
from solvers import Collocation, MultipleShooting, StagewiseNewton, certify
from solvers.direct.first_trajectory import first_states

SHOOTING = (MultipleShooting(40), MultipleShooting(40, backend="fatrop"))


def upright(horizon: float) -> OCP:
    """A linearised inverted pendulum: left to itself it grows by exp(3.13 t)."""
    angle, rate, torque = (ca.SX.sym(name) for name in ("angle", "rate", "torque"))
    x = ca.vertcat(angle, rate)
    return OCP(
        name="upright",
        model=Model(name="upright", x=x, u=torque, f=ca.vertcat(rate, 9.81 * angle + torque)),
        x0=[0.05, 0.0],
        horizon=horizon,
        running_cost=10 * angle**2 + rate**2 + 0.01 * torque**2,
        control_bounds=Box(-2, 2),
    )


@pytest.mark.many
@pytest.mark.parametrize("horizon", [6.0, 20.0])
@pytest.mark.parametrize("method", [MultipleShooting, StagewiseNewton, Collocation])
def test_an_unstable_system_is_solved_as_from_rest(
    horizon: float, method: Callable[[int], Solver]
) -> None:
    # Open loop, rounding grows by e^60 over the longer horizon: judged, neither is a success.
    ocp, sized = upright(horizon), method(int(20 * horizon)).unjudged()
    own = solve(ocp, sized)
    at_rest = solve(ocp, sized, guess=Guess(x=[0.0, 0.0], u=[0.0]))
    assert own.status is at_rest.status is Status.SOLVED
    assert own.cost == pytest.approx(at_rest.cost, rel=1e-7)
    assert own.u[0] == pytest.approx(at_rest.u[0], rel=1e-5)


@pytest.mark.parametrize(
    ("growth", "tame"), [(0.0, True), (0.8, True), (5.0, False), (np.inf, False)]
)
def test_only_a_roll_out_that_explodes_is_replaced(growth: float, tame: bool) -> None:
    t, x0 = np.linspace(0.0, 4.0, 41), np.array([2.0])
    with np.errstate(invalid="ignore"):
        rolled = 2.0 * np.exp(growth * t)[:, None]
    x = first_states(x0, 41, Box(-np.inf, np.inf), lambda: rolled, "tame")
    assert (x == (rolled if tame else 2.0)).all()


def test_a_polynomial_roll_out_is_kept() -> None:
    t = np.linspace(0.0, 1000.0, 101)
    rolled = np.stack([t**4, t**3, np.zeros_like(t)], axis=1)
    x = first_states(np.zeros(3), 101, Box([-np.inf] * 3, [np.inf] * 3), lambda: rolled, "tame")
    assert x is rolled


# -- free final times ----------------------------------------------------------------------


def quickest(guess: float, start: list[float], end: list[float]) -> OCP:
    q, v, force, t = (ca.SX.sym(name) for name in ("q", "v", "force", "t"))
    x = ca.vertcat(q, v)
    return OCP(
        name="quickest",
        model=Model(name="cart", x=x, u=force, f=ca.vertcat(v, force), t=t),
        x0=start,
        horizon=FreeTime(guess),
        terminal_cost=t,
        control_bounds=Box(-1, 1),
        constraints=(Constraint("end", x, end, end, at="terminal"),),
    )


@pytest.mark.many
@pytest.mark.parametrize("solver", [MultipleShooting(60), Collocation(20)], ids=repr)
@pytest.mark.parametrize("guess", [0.5, 2.0, 8.0])
def test_a_short_guess_of_the_final_time_is_lengthened(guess: float, solver: Solver) -> None:
    """From 1 m at 2 m/s back to rest at 0: 2 + 2 sqrt(3) s."""
    solution = solve(quickest(guess, [1.0, 2.0], [0.0, 0.0]), solver)
    assert solution.status is Status.SOLVED
    assert solution.cost == pytest.approx(2.0 + 2.0 * np.sqrt(3.0), rel=1e-3)
    if guess < 1.0:
        assert "a guess of the final time of 8 s" in solution.message


def test_what_no_final_time_can_do_names_the_guesses() -> None:
    ocp = quickest(1.0, [1.0, 2.0], [0.0, 0.0])
    short = OCP(
        name="too short",
        model=ocp.model,
        x0=[1.0, 2.0],
        horizon=FreeTime(1.0, 0.5, 3.0),
        terminal_cost=ocp.terminal_cost,
        control_bounds=Box(-1, 1),
        constraints=ocp.constraints,
    )
    solution = solve(short, MultipleShooting(40))
    assert solution.status is Status.INFEASIBLE
    assert "'end' is violated" in solution.message
    assert "guesses of the final time of 3 s, 0.5 s lead nowhere either" in solution.message


# -- starts without a slope -----------------------------------------------------------------


def dragged(start: list[float]) -> OCP:
    """Quadratic drag, whose slope is 0/0 at rest."""
    place, v, force = (ca.SX.sym(name, 2) for name in ("place", "v", "force"))
    x = ca.vertcat(place, v)
    end = [1, 1, 0.2, 0]
    return OCP(
        name="dragged",
        model=Model(name="dragged", x=x, u=force, f=ca.vertcat(v, force - ca.norm_2(v) * v / 2)),
        x0=start,
        horizon=2.0,
        running_cost=ca.sumsqr(force),
        constraints=(Constraint("end", x, end, end, at="terminal"),),
    )


@pytest.mark.parametrize("solver", SHOOTING, ids=lambda s: s.backend)
def test_a_fixed_start_is_not_differentiated(solver: MultipleShooting) -> None:
    guess = Guess(x=np.linspace([0, 0, 0.1, 0.1], [1, 1, 0.2, 0.1], 11), u=[0.3, 0.2])
    at_rest = solve(dragged([0.0, 0.0, 0.0, 0.0]), solver, guess=guess)
    near = solve(dragged([0.0, 0.0, 1e-7, 0.0]), solver, guess=guess)
    assert at_rest.status is near.status is Status.SOLVED
    assert at_rest.cost == pytest.approx(near.cost, rel=1e-6)
    # Places do not enter the drag: their costates are exact, those of the speeds nearly.
    assert at_rest.costate[0, :2] == pytest.approx(near.costate[0, :2], rel=1e-5)
    assert at_rest.costate[0, 2:] == pytest.approx(near.costate[0, 2:], rel=0.1)


@pytest.mark.slow
def test_an_optimum_from_such_a_start_is_certified() -> None:
    guess = Guess(x=np.linspace([0, 0, 0.1, 0.1], [1, 1, 0.2, 0.1], 11), u=[0.3, 0.2])
    solution = solve(dragged([0.0, 0.0, 0.0, 0.0]), Collocation(25), guess=guess)
    assert "certified, 2.7145" in str(certify(solution))


@pytest.mark.parametrize("start", [[0.0, 0.0, 0.3, 0.1], [0.5, 0.0, 0.2, 0.0]])
def test_costates_of_a_start_as_data_are_those_of_an_unknown(start: list[float]) -> None:
    """The gradient of the first stage is what the multiplier of its equal bounds would be."""
    ocp, guess = dragged(start), Guess(x=np.linspace(start, [1, 1, 0.2, 0.1], 11), u=[0.3, 0.2])
    program = MultipleShooting(40).prepare(ocp)
    data = RunData.of(ocp)
    usual = program.run(guess=guess)
    z, u = program.first_iterate(data, guess)
    outcome = program._nlp_run_without_slope.solve(program.transcription.join(z, u), data)
    last = outcome.last
    as_data = Transcription(ocp, 40, RK4(), start_as_data=True)
    costates = as_data.costates(last.w, last.lam_x, last.lam_g, data)
    assert costates == pytest.approx(usual.costate, rel=1e-6, abs=1e-8)


# -- what is evaluated at construction --------------------------------------------------------


def spending(box: Box, guess: Guess | None) -> OCP:
    money, rate, t = (ca.SX.sym(name) for name in ("money", "rate", "t"))
    return OCP(
        name="spending",
        model=Model(name="account", x=money, u=rate, f=0.05 * money - rate, t=t),
        x0=[100.0],
        horizon=10.0,
        running_cost=-ca.exp(-0.01 * t) * ca.log(rate),
        control_bounds=box,
        constraints=(Constraint("all", money, 0, 0, at="terminal"),),
        guess=guess,
    )


@pytest.mark.parametrize("lower", [-np.inf, 0.0, 1e-6])
def test_expressions_are_evaluated_where_the_guess_is(lower: float) -> None:
    solution = solve(spending(Box(lower, np.inf), Guess(u=[10.0])), Collocation(20))
    assert solution.status is Status.SOLVED
    assert solution.cost == pytest.approx(-24.255378461, abs=1e-8)


def test_without_a_guess_in_the_middle_of_the_bounds_and_the_expression_is_named() -> None:
    assert spending(Box(0.0, 20.0), None).name == "spending"
    assert spending(Box(0.0, np.inf), None).name == "spending"
    with pytest.raises(ProblemError, match=r"running_cost .* not finite .*log\(rate\)"):
        spending(Box(-20.0, 0.0), None)
