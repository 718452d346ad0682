"""The augmented Lagrangian: closed forms, every inner solver, honest failures, bad input."""

from dataclasses import replace

import numpy as np
import pytest

from models.textbook import bryson_denham
from ocp import (
    Constraint,
    ProblemError,
    Solution,
    Solver,
    Status,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import AugmentedLagrangian, IndirectShooting, MultipleShooting, Schuetz
from solvers.constrained.relaxed_problem import MULTIPLIER, PENALTY, SCALE, RelaxedProblem
from tests.solvers.problems import ends, point

N = 60
# Held controls on 60 intervals and multipliers at their nodes: O(h^2) of the cost.
GRID = 2e-3
INNER: tuple[Solver, ...] = (
    MultipleShooting(N),
    Schuetz.sound(intervals=N),
    IndirectShooting(segments=N, steps=4 * N),
)


def under_a_ceiling(level: float = 0.2):
    """Cost u^2/2 + (x - 1)^2/2 from 0 in 2 s, x <= level: up to the ceiling and along it."""
    return point(
        name="ceiling",
        horizon=2.0,
        running_cost=lambda x, u: u**2 / 2 + (x - 1) ** 2 / 2,
        constraints=lambda x, u: (Constraint("ceiling", x, upper=level),),
    )


def ceiling_cost(level: float = 0.2) -> float:
    r"""Cost in closed form: contact at t1, where x = level and u = 0 (tangential entry).

    Before, (x - 1)'' = x - 1, so with u(t1) = 0: x - 1 = (level - 1) cosh(t1 - t), and
    x(0) = 0 gives cosh t1 = 1 / (1 - level). The integral of u^2/2 + (x - 1)^2/2 is
    (1 - level)^2 sinh(2 t1)/4, and on the ceiling (1 - level)^2/2 per second.
    """
    t1, depth = np.arccosh(1.0 / (1.0 - level)), 1.0 - level
    return depth**2 * (np.sinh(2 * t1) / 4 + (2.0 - t1) / 2)


@pytest.mark.slow
@pytest.mark.parametrize("inner", INNER, ids=lambda s: type(s).__name__)
def test_ceiling_in_closed_form(inner: Solver) -> None:
    solution = solve(under_a_ceiling(), AugmentedLagrangian(inner, intervals=N))
    verdict = evaluate(solution)
    assert solution.status.is_success, solution.message
    assert solution.problem.constraints, "the answer is one of the problem, not of the relaxed one"
    assert verdict.violation <= 1e-6
    assert verdict.cost == pytest.approx(ceiling_cost(), rel=GRID)
    assert verdict.defect < 1e-3
    assert solution.work.rollouts > 0


def test_multiplier_in_closed_form() -> None:
    """On the ceiling H_x + costate' = 0 with costate = -u = 0: mu = 1 - level."""
    solution = solve(under_a_ceiling(), AugmentedLagrangian(MultipleShooting(N), intervals=N))
    t, multiplier = np.linspace(0.0, 2.0, N + 1), solution.history["multiplier"][:, 0]
    t1 = np.arccosh(1.25)
    inside = (t > t1 + 0.3) & (t < 1.8)
    assert np.median(multiplier[inside]) == pytest.approx(0.8, rel=1e-2)
    assert (multiplier[t < t1 - 0.2] == 0.0).all()
    assert (multiplier >= 0.0).all()


def test_history_of_the_rounds() -> None:
    solution = solve(under_a_ceiling(), AugmentedLagrangian(MultipleShooting(N), intervals=N))
    history = solution.history
    rounds = len(history["penalty"])
    assert rounds == solution.iterations
    assert all(len(history[k]) == rounds for k in ("violation", "complementarity", "cost"))
    assert (np.diff(history["penalty"]) >= 0.0).all()
    assert history["violation"][-1] <= 1e-6 < history["violation"][0]


@pytest.mark.slow
def test_terminal_equation_for_schuetz() -> None:
    """From 0 to 1 in 1 s with u = 1: cost 1; an end that Schuetz cannot take by itself."""
    ocp = point(constraints=ends(1.0))
    with pytest.raises(UnsupportedProblem):
        Schuetz.sound().build(ocp)
    solver = AugmentedLagrangian(Schuetz.sound(intervals=N), intervals=N, penalty=10.0)
    solution = solve(ocp, solver)
    assert solution.status.is_success, solution.message
    assert evaluate(solution).violation <= 1e-6
    assert evaluate(solution).cost == pytest.approx(1.0, rel=1e-5)
    # The costate of the relaxed problem is -u'' = 0, minus 2: dJ*/dx = -2.
    assert solution.history["terminal multiplier"][0] == pytest.approx(-2.0, rel=1e-4)


def test_relaxed_cost_against_differences() -> None:
    """P(c, mu, rho) = (max(0, mu + rho c)^2 - mu^2) / (2 rho), and its slope in c."""
    relaxed = RelaxedProblem.of(under_a_ceiling(), N).ocp
    cost = relaxed.functions.running_cost
    bare = under_a_ceiling().functions.running_cost
    names = [entry.name for entry in relaxed.parameters]
    assert names == [PENALTY, SCALE, MULTIPLIER, "multiplier of the end"]

    def term(x: float, mu: float, rho: float) -> float:
        scale = 0.25
        p = [rho, scale, mu, 0.0]
        return float(cost(x, 0.3, 0.0, p)) / scale - float(bare(x, 0.3, 0.0, []))

    for x, mu, rho in ((0.1, 0.0, 10.0), (0.3, 0.0, 10.0), (0.15, 2.0, 10.0), (0.2, 0.5, 3.0)):
        pushed = max(0.0, mu + rho * (x - 0.2))
        assert term(x, mu, rho) == pytest.approx((pushed**2 - mu**2) / (2 * rho), abs=1e-12)
        slope = (term(x + 1e-6, mu, rho) - term(x - 1e-6, mu, rho)) / 2e-6
        assert slope == pytest.approx(pushed, abs=1e-5)


def test_relaxed_problem_is_honest_about_its_smoothness() -> None:
    relaxed = RelaxedProblem.of(under_a_ceiling(), N).ocp
    assert relaxed.smoothness == 1
    assert not relaxed.constraints
    assert not relaxed.state_bounds.is_active


@pytest.mark.slow
@pytest.mark.parametrize("inner", INNER, ids=lambda s: type(s).__name__)
def test_no_clear_path(inner: Solver) -> None:
    """x must be above t / 2 and below 0.2: nothing can be from t = 0.4 s on."""
    ocp = under_a_ceiling()
    x, t = ocp.model.x, ocp.model.t
    both = (*ocp.constraints, Constraint("floor", x - t / 2, lower=-0.05))
    solution = solve(replace(ocp, constraints=both), AugmentedLagrangian(inner, intervals=N))
    assert solution.status is Status.INFEASIBLE
    assert "is violated by" in solution.message
    assert "at t = " in solution.message
    assert finite(solution)


def test_start_that_violates_is_called_infeasible_at_once() -> None:
    ocp = replace(under_a_ceiling(), x0=0.5)
    solution = solve(ocp, AugmentedLagrangian(MultipleShooting(N), intervals=N))
    assert solution.status is Status.INFEASIBLE
    assert solution.iterations == 1
    assert "'ceiling' is violated by 0.3 at t = 0 s" in solution.message


def test_equation_along_the_path() -> None:
    """Along x = t the control is 1: cost 1, though the cost alone would stay at 0."""
    ocp = point(constraints=lambda x, u: (Constraint("rail", u, 1.0, 1.0),))
    solver = AugmentedLagrangian(Schuetz.sound(intervals=N), intervals=N)
    solution = solve(ocp, solver)
    assert solution.status.is_success, solution.message
    assert evaluate(solution).cost == pytest.approx(1.0, rel=1e-5)
    # H_u = 2 u + mu = 0.
    assert solution.history["multiplier"] == pytest.approx(-2.0, rel=1e-3)


@pytest.mark.slow
def test_from_its_own_answer_it_needs_no_more_rounds() -> None:
    """Only the trajectory is warm: multipliers begin anew, and the work of a round may differ."""
    ocp, solver = under_a_ceiling(), AugmentedLagrangian(Schuetz.sound(intervals=N), intervals=N)
    program = solver.build(ocp)
    first = program.run()
    again = program.run(guess=first)
    assert again.status.is_success
    assert again.iterations <= first.iterations
    assert again.cost == pytest.approx(first.cost, rel=1e-6)


def test_runs_with_another_start_and_save(tmp_path) -> None:
    ocp = under_a_ceiling()
    program = AugmentedLagrangian(MultipleShooting(N), intervals=N).build(ocp)
    solution = program.run(x0=[-0.3])
    assert solution.status.is_success
    assert solution.x[0, 0] == -0.3
    loaded = Solution.load(solution.save(tmp_path / "s"), ocp)
    assert np.array_equal(loaded.history["multiplier"], solution.history["multiplier"])


def test_what_is_refused() -> None:
    free = point()
    with pytest.raises(UnsupportedProblem, match="no path, state or terminal constraint"):
        AugmentedLagrangian(Schuetz.sound()).build(free)
    with pytest.raises(ProblemError, match="inner"):
        AugmentedLagrangian("ipopt")  # pyright: ignore[reportArgumentType]
    for bad in (
        {"penalty": 0.0},
        {"penalty": 10.0, "largest_penalty": 1.0},
        {"growth": 1.0},
        {"tolerance": 0.0},
        {"complementarity": -1.0},
        {"intervals": 0},
        {"max_iterations": 0},
        {"penalty": np.nan},
    ):
        with pytest.raises(ProblemError):
            AugmentedLagrangian(Schuetz.sound(), **bad)  # pyright: ignore[reportArgumentType]


def test_a_failing_inner_solver_is_named() -> None:
    """Newton allowed a single step gets nowhere: its own status comes back, all finite."""
    inner = IndirectShooting(steps=20, max_steps=1)
    solution = solve(bryson_denham(), AugmentedLagrangian(inner, intervals=N))
    assert not solution.status.is_success
    assert "inner solver" in solution.message
    assert finite(solution)


def finite(solution: Solution) -> bool:
    arrays = (solution.t, solution.x, solution.u, solution.costate)
    return all(np.isfinite(a).all() for a in arrays)
