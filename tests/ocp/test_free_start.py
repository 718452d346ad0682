"""A start that is free in parts: the same problem by every kind of method, and bad input."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from ocp import (
    OCP,
    Box,
    Constraint,
    Guess,
    Model,
    ProblemError,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import (
    AugmentedLagrangian,
    Collocation,
    GridDP,
    IndirectShooting,
    MultipleShooting,
    Riccati,
    Schuetz,
    StagewiseNewton,
    polish,
)
from tests.ocp.mass import MASS, pushed
from tests.ocp.mass import POSITION as X
from tests.ocp.mass import VELOCITY as V


def mass(**changes: Any) -> OCP:
    """From position 0, with any velocity, to rest at 1 in 1 s, with little force."""
    return pushed(**({"name": "running jump", "free_start": ("velocity",)} | changes))


# With a first velocity v0 the best force is u = a + b t; rest at 1 asks for a + b/2 = -v0 and
# a/2 + b/6 = 1 - v0. Where v0 is free the costate of the velocity, -u, is 0 at the start: a = 0,
# b = -3, v0 = 3/2.
def _cost(v0: float) -> float:
    a, b = np.linalg.solve([[1.0, 0.5], [0.5, 1.0 / 6.0]], [-v0, 1.0 - v0])
    return (a * a + a * b + b * b / 3.0) / 2.0


BEST = 1.5
SOLVERS = [
    MultipleShooting(20),
    MultipleShooting(20, backend="fatrop"),
    Collocation(5),
    IndirectShooting(20),
]


@pytest.mark.parametrize("solver", SOLVERS, ids=repr)
def test_a_free_velocity_is_chosen(solver):
    found = solve(mass(), solver).or_raise()
    assert found.x[0] == pytest.approx([0.0, BEST], abs=2e-2)
    assert evaluate(found).cost == pytest.approx(_cost(BEST), rel=3e-3)
    # Transversality: nothing is gained by another velocity.
    assert found.costate[0, 1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("solver", [Collocation(5), IndirectShooting(20)], ids=repr)
def test_what_is_given_of_the_start_is_an_argument_of_the_run(solver):
    program = solver.build(mass())
    found = program.run(x0=[0.5, 7.0]).or_raise()
    assert found.x[0] == pytest.approx([0.5, BEST / 2], abs=1e-6)
    assert evaluate(found).cost == pytest.approx(_cost(BEST) / 4, rel=1e-6)


@pytest.mark.parametrize("solver", SOLVERS[:3], ids=repr)
def test_a_bound_of_the_start_holds_there_alone(solver):
    ocp = mass(start_bounds=Box([-np.inf, -np.inf], [np.inf, 0.2]))
    found = solve(ocp, solver).or_raise()
    verdict = evaluate(found)
    assert found.x[0, 1] == pytest.approx(0.2, abs=1e-6)
    assert found.x[:, 1].max() > 1.0
    assert verdict.cost == pytest.approx(_cost(0.2), rel=3e-3)
    # The price of the bound: dJ/dv0.
    slope = (_cost(0.2 + 1e-6) - _cost(0.2 - 1e-6)) / 2e-6
    assert found.costate[0, 1] == pytest.approx(slope, rel=2e-2)
    assert verdict.stationarity == pytest.approx(0.0, abs=2e-2)


def test_the_referee_sees_a_start_outside_its_bounds():
    ocp = mass(start_bounds=Box([-np.inf, -np.inf], [np.inf, 0.2]))
    found = solve(mass(), Collocation(5)).with_(problem=ocp)
    verdict = evaluate(found)
    assert verdict.violation == pytest.approx(BEST - 0.2, abs=1e-6)
    assert verdict.worst == "bound of velocity"


def test_indirect_shooting_says_that_it_imposes_no_bound_of_the_start():
    ocp = mass(start_bounds=Box([-np.inf, -np.inf], [np.inf, 0.2]))
    found = solve(ocp, IndirectShooting(20))
    assert not found.status.is_success
    assert "start is outside its bounds" in found.message


def test_polish_makes_it_exact():
    exact = polish(solve(mass(), MultipleShooting(20)))
    assert exact.or_raise().x[0, 1] == pytest.approx(BEST, abs=1e-8)


def test_in_other_sizes_it_is_the_same():
    far = 1e6
    arrival = Constraint("arrival", MASS.x, [far, 0.0], [far, 0.0], at="terminal")
    bounds = Box([-np.inf, -np.inf], [np.inf, 0.2 * far])
    found = solve(mass(constraints=(arrival,), start_bounds=bounds), Collocation(5)).or_raise()
    assert found.x[0, 1] == pytest.approx(0.2 * far, rel=1e-6)


def test_with_a_manifold_only_what_is_named_is_free():
    line = Constraint("line", X + V, 1.0, 1.0, at="initial")
    ocp = mass(x0=[0.0, 1.0], constraints=(line,), terminal_cost=50 * (X - 1) ** 2 + 50 * V**2)
    direct, indirect = (solve(ocp, s).or_raise() for s in (Collocation(5), IndirectShooting(20)))
    assert direct.x[0] == pytest.approx([0.0, 1.0], abs=1e-9)
    assert evaluate(direct).cost == pytest.approx(evaluate(indirect).cost, rel=1e-6)


@pytest.mark.parametrize("solver", [StagewiseNewton(20), Schuetz(20)], ids=repr)
def test_methods_without_constraints_refuse_it_too(solver):
    ocp = mass(constraints=(), terminal_cost=50 * (X - 1) ** 2 + 50 * V**2)
    with pytest.raises(UnsupportedProblem, match="velocity"):
        solver.build(ocp)


def test_the_augmented_lagrangian_frees_it_around_a_solver_that_can():
    found = solve(mass(), AugmentedLagrangian(MultipleShooting(20))).or_raise()
    assert found.x[0, 1] == pytest.approx(BEST, abs=2e-2)


@pytest.mark.parametrize("solver", [GridDP((5, 5)), Riccati()], ids=repr)
def test_methods_that_need_a_start_refuse_by_name(solver):
    u = ca.SX.sym("u")
    model = Model(name="m", x=MASS.x, u=u, f=MASS.x + ca.vertcat(V, u), dt=0.1)
    ocp = OCP(
        name="steps", model=model, x0=[0, 0], horizon=3, running_cost=u**2, free_start=("velocity",)
    )
    with pytest.raises(UnsupportedProblem, match="velocity"):
        solver.build(ocp)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"free_start": ("speed",)}, "'speed' is no state; they are position, velocity"),
        ({"free_start": "velocity"}, "free_start"),
        ({"free_start": (1,)}, "an entry of free_start"),
        ({"start_bounds": Box([0, 0], [0.5, 1])}, "start of position is given"),
        ({"start_bounds": Box([0], [1])}, "start_bounds"),
        (
            {
                "state_bounds": Box([-9, 2], [9, 3]),
                "start_bounds": Box([-np.inf, 0], [np.inf, 1]),
                "x0": [0, 2],
            },
            "no number lies between",
        ),
    ],
)
def test_bad_input(changes, said):
    with pytest.raises(ProblemError, match=said):
        mass(**changes)


def test_it_is_said_in_the_description():
    text = mass(start_bounds=Box([-np.inf, 0], [np.inf, 0.2])).describe()
    assert "x(0) = (0, 0)   (velocity: guess)" in text
    assert "0 <= velocity(0) <= 0.2" in text


def test_a_guess_of_the_whole_start_is_used():
    found = solve(mass(), IndirectShooting(20), guess=Guess(x=[0.0, 1.4])).or_raise()
    assert found.x[0, 1] == pytest.approx(BEST, abs=1e-6)
