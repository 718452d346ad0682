"""What a backend returns is judged by its answer: saddles, acceptable points, words."""

import casadi as ca
import numpy as np
import pytest

from ocp import OCP, Box, Constraint, FreeTime, Model, Status, solve
from solvers import Collocation, MultipleShooting, refine_mesh
from solvers.direct.return_words import meaning


def returning(horizon: float) -> OCP:
    """From 0 to 0 with the cost u^2 - x^2: x = 0 is a minimum up to pi, beyond unbounded below."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return OCP(
        name="returning",
        model=Model(name="returning", x=x, u=u, f=u),
        x0=[0.0],
        horizon=horizon,
        running_cost=u**2 - x**2,
        constraints=(Constraint("back", x, 0, 0, at="terminal"),),
    )


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_no_saddle_is_solved(backend) -> None:
    assert solve(returning(4.0), MultipleShooting(40, backend=backend)).status is Status.DIVERGED
    at_rest = solve(returning(3.0), MultipleShooting(40, backend=backend))
    assert at_rest.status is Status.SOLVED
    assert at_rest.cost == pytest.approx(0.0, abs=1e-12)


def mirrored() -> OCP:
    """To 1 in 1 s; moving sideways by either y lowers the cost: 0 is stationary by symmetry."""
    x, y, u, v = (ca.SX.sym(name) for name in "xyuv")
    return OCP(
        name="mirrored",
        model=Model(name="mirrored", x=ca.vertcat(x, y), u=ca.vertcat(u, v), f=ca.vertcat(u, v)),
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=u**2 + v**2 - 8 * y**2 + 4 * y**4,
        constraints=(Constraint("end", x, 1, 1, at="terminal"),),
    )


@pytest.mark.parametrize(
    "solver", [MultipleShooting(40), MultipleShooting(40, backend="fatrop"), Collocation(10)]
)
def test_a_control_that_never_moved_is_perturbed(solver) -> None:
    solution = solve(mirrored(), solver)
    assert solution.status is Status.SOLVED
    assert np.abs(solution.u[:, 1]).max() > 0.1
    assert solution.cost < 0.7


def test_a_control_at_its_optimum_is_left_there() -> None:
    """From a minimum the second run brings nothing better, and the first answer is kept."""
    x, y, u, v = (ca.SX.sym(name) for name in "xyuv")
    ocp = OCP(
        name="straight",
        model=Model(name="straight", x=ca.vertcat(x, y), u=ca.vertcat(u, v), f=ca.vertcat(u, v)),
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=u**2 + v**2 + y**2,
        constraints=(Constraint("end", x, 1, 1, at="terminal"),),
    )
    solution = solve(ocp, MultipleShooting(20))
    assert solution.status is Status.SOLVED
    assert not solution.message
    assert (solution.u[:, 1] == 0.0).all()


def turning() -> OCP:
    """A rigid body turned by 150 degrees about its first axis in least time.

    The unit quaternion makes seven terminal equations of six, whose gradients depend on each other
    at the end; about the first axis alone is a saddle.
    """
    q, w, u = ca.SX.sym("q", 4), ca.SX.sym("w", 3), ca.SX.sym("u", 3)
    inertia, half = ca.DM([5621.0, 4547.0, 2364.0]), np.deg2rad(75)
    rates = ca.vertcat(q[3] * w + ca.cross(q[:3], w), -ca.dot(q[:3], w)) / 2
    spin = (u - ca.cross(w, inertia * w)) / inertia
    end = [np.sin(half), 0, 0, np.cos(half), 0, 0, 0]
    x = ca.vertcat(q, w)
    return OCP(
        name="turning",
        model=Model(name="body", x=x, u=u, f=ca.vertcat(rates, spin)),
        x0=[0, 0, 0, 1, 0, 0, 0],
        horizon=FreeTime(30.0, 25.0, 35.0),
        running_cost=1.0,
        control_bounds=Box(-50, 50),
        constraints=(Constraint("end", x, end, end, at="terminal"),),
    )


@pytest.mark.slow
def test_dependent_terminal_equations_and_a_saddle_by_symmetry() -> None:
    solution = solve(turning(), MultipleShooting(100))
    assert solution.status is Status.SOLVED
    assert solution.cost == pytest.approx(28.6325, abs=1e-3)
    assert np.abs(solution.u[:, 1:]).max(axis=0) == pytest.approx([50.0, 50.0], rel=1e-3)


# -- acceptable points -----------------------------------------------------------------------


def rod(points: int) -> OCP:
    """A rod heated at one end, whose multipliers a backend cannot balance to 1e-9."""
    dx = 1 / (points - 1)
    a = (np.eye(points, k=1) - 2 * np.eye(points) + np.eye(points, k=-1)) / dx**2
    a[0, 1] = a[-1, -2] = 2 / dx**2
    b, weights = np.zeros(points), np.full(points, dx)
    b[-1] = 2 / dx
    weights[[0, -1]] /= 2
    goal = 0.25 * (1 + np.linspace(0, 1, points) ** 2)
    x, u = ca.SX.sym("x", points), ca.SX.sym("u")
    return OCP(
        name="rod",
        model=Model(name="rod", x=x, u=u, f=ca.sparsify(ca.DM(a)) @ x + ca.DM(b) * u),
        x0=np.zeros(points),
        horizon=0.5,
        running_cost=0.01 * u**2,
        terminal_cost=100 * ca.dot(ca.DM(weights), (x - goal) ** 2),
    )


@pytest.mark.slow
def test_the_limit_at_the_optimum_is_accepted_and_said() -> None:
    solver = Collocation(25, degree=3, max_iterations=10, tolerance=1e-13, accuracy=1e99)
    solution = solve(rod(100), solver)
    assert solution.status is Status.SOLVED
    assert "to an acceptable level: residual" in solution.message
    assert 0.0 < solution.residual < 1e-3
    assert solution.cost == pytest.approx(0.0023694104, rel=1e-3)


def test_a_limit_far_from_the_optimum_is_none() -> None:
    solution = solve(mirrored(), MultipleShooting(40, max_iterations=1))
    assert solution.status is Status.ITERATION_LIMIT


@pytest.mark.parametrize(
    ("backend", "word", "status", "said"),
    [
        ("fatrop", "1", Status.FAILED, "no step was accepted"),
        ("ipopt", "Restoration_Failed", Status.FAILED, "no point that violates"),
        ("ipopt", "Maximum_WallTime_Exceeded", Status.TIME_LIMIT, "time limit"),
        ("ipopt", "Invalid_Number_Detected", Status.FAILED, "not finite"),
        ("ipopt", "Something_New", Status.FAILED, "Something_New"),
    ],
)
def test_words_of_backends_are_translated(
    backend: str, word: str, status: Status, said: str
) -> None:
    assert meaning(backend, word).status is status
    assert said in meaning(backend, word).sentence


# -- meshes ------------------------------------------------------------------------------------


def test_a_mesh_that_was_solved_is_not_lost() -> None:
    """A later round that fails leaves the best one, and its reason in the message."""
    ocp = mirrored()
    start = solve(ocp, MultipleShooting(40))
    full = refine_mesh(start, accuracy=1e-13, rounds=3, solver=Collocation(2, degree=2))
    assert [each.status for each in full.rounds] == [Status.SOLVED] * 3
    assert all(each.solution.cost == each.cost for each in full.rounds)
    limited = refine_mesh(start, solver=Collocation(2, degree=2, time_limit=1e-9))
    assert limited.rounds[-1].status is Status.TIME_LIMIT
    assert limited.solution.status is Status.SOLVED
    assert limited.solution.cost == start.cost
    assert "TIME_LIMIT" in limited.solution.message
