"""Solutions: between the nodes, on disk, and what they refuse to hold."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from ocp import (
    OCP,
    Box,
    Constraint,
    FreeTime,
    Guess,
    Model,
    Parameter,
    ProblemError,
    Solution,
    SolverError,
    Status,
    Work,
    evaluate,
    solve,
)
from ocp.problem.fingerprint import fingerprint
from solvers import IndirectShooting, MultipleShooting
from tests.ocp.problems import energy, integrator, pendulum, trajectory
from tests.tolerances import ORDER, ROUNDING

U = np.array([[1.0], [3.0], [-1.0], [0.5]])


def full(ocp: OCP | None = None) -> Solution:
    """Return a solution with every field set to something."""
    return trajectory(
        ocp or pendulum(),
        np.arange(8.0).reshape(4, 2),
        message="here and there",
        costate=np.arange(10.0).reshape(5, 2),
        residual=1e-7,
        iterations=12,
        work=Work(3, 4, 5),
        history={"cost": np.array([3.0, 2.0]), "residual": np.array([])},
        parameters={"gain": np.array([2.0]), "held": np.ones((6, 1))},
        build_time=0.25,
        solve_time=0.5,
    )


# -- between the nodes ----------------------------------------------------------------


def test_a_held_control_takes_the_value_of_the_interval_that_begins() -> None:
    solution = trajectory(integrator(), U)
    got = solution.control([-1.0, 0.0, 0.1, 0.25, 0.49, 0.75, 1.0, 2.0])
    np.testing.assert_array_equal(got[:, 0], [1.0, 1.0, 1.0, 3.0, 3.0, 0.5, 0.5, 0.5])
    assert solution.control(0.3).shape == (1,)
    # Time as a sum of steps misses a node by rounding.
    np.testing.assert_array_equal(solution.control(0.25 - 1e-12), [3.0])


def test_linear_controls_states_and_costates() -> None:
    x, costate = np.array([[0.0], [1.0], [4.0], [9.0]]), np.ones((4, 1))
    solution = trajectory(integrator(), U, "linear", x=x, costate=costate)
    np.testing.assert_allclose(solution.control(np.array([0.5, 5 / 6])), [[1.0], [-0.25]])
    assert solution.state(1 / 6) == pytest.approx(0.5)
    np.testing.assert_allclose(solution.state([0.0, 0.5, 1.0])[:, 0], [0.0, 2.5, 9.0])
    np.testing.assert_allclose(solution.costate_at([0.2, 0.9]), [[1.0], [1.0]])
    assert solution.duration == 1.0


def test_states_are_compared_at_the_nodes_of_the_coarser_grid() -> None:
    coarse = trajectory(integrator(), np.zeros((2, 1)), x=np.array([[0.0], [1.0], [3.0]]))
    fine = trajectory(
        integrator(), np.zeros((4, 1)), x=np.array([[0.0], [9.0], [1.5], [9.0], [3.0]])
    )
    assert coarse.states_apart(fine) == fine.states_apart(coarse) == pytest.approx(0.5)


def extremal(ocp: OCP) -> Solution:
    program = IndirectShooting(segments=5, steps=320).build(ocp)
    return program.run(guess=solve(ocp, MultipleShooting(intervals=20))).or_raise()


def test_an_extremal_is_smooth_between_its_nodes() -> None:
    """Order 4 in the distance of the nodes, of state, costate and control."""
    signals = {"held": np.full((2, 1), 0.3), "linear": np.array([[0.1], [0.4]])}
    ocp = pendulum()
    program = IndirectShooting(segments=5, steps=320).build(ocp)
    guess = MultipleShooting(intervals=20).build(ocp).run(parameters=signals)
    fine = program.run(guess=guess, parameters=signals).or_raise()
    arrays = ("t", "x", "costate", "u")
    errors = []
    for stride in (80, 40, 20):
        coarse = fine.with_(**{name: getattr(fine, name)[::stride] for name in arrays})
        np.testing.assert_allclose(coarse.control(coarse.t), coarse.u, atol=ROUNDING)
        np.testing.assert_allclose(coarse.state(coarse.t), coarse.x, atol=ROUNDING)
        between = [
            np.abs(coarse.control(fine.t) - fine.u).max(),
            np.abs(coarse.state(fine.t) - fine.x).max(),
            np.abs(coarse.costate_at(fine.t) - fine.costate).max(),
        ]
        errors.append(between)
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    # At these few nodes the order is still being reached, from either side.
    assert (orders[-1] > 4.0 - 2 * ORDER).all()
    assert max(errors[-1]) < 1e-4


def test_an_extremal_meets_signals_that_jump_at_its_nodes() -> None:
    """The signal has thirds, the nodes are on them: its jumps make no error in between."""
    fine = extremal_of_thirds()
    coarse = fine.with_(**{n: getattr(fine, n)[::20] for n in ("t", "x", "costate", "u")})
    away = np.abs(coarse.state(fine.t) - fine.x).max()
    assert away < 1e-5


def extremal_of_thirds() -> Solution:
    ocp = pendulum()
    signals = {"linear": np.zeros((4, 1))}
    guess = MultipleShooting(intervals=21).build(ocp).run(parameters=signals)
    program = IndirectShooting(segments=6, steps=360).build(ocp)
    return program.run(guess=guess, parameters=signals).or_raise()


def test_the_control_of_an_extremal_is_exact_where_it_is_a_line() -> None:
    """Energy problem (problems.energy): cubics and lines, so two nodes would do."""
    fine = extremal(energy())
    coarse = fine.with_(**{n: getattr(fine, n)[::160] for n in ("t", "x", "costate", "u")})
    t = np.linspace(0.0, 1.0, 17)
    np.testing.assert_allclose(coarse.control(t)[:, 0], 6 - 12 * t, atol=1e-9)
    np.testing.assert_allclose(coarse.state(t)[:, 0], 3 * t**2 - 2 * t**3, atol=1e-9)
    assert coarse.control(0.5).shape == (1,)
    np.testing.assert_allclose(coarse.state([-1.0, 2.0]), coarse.x[[0, -1]], atol=ROUNDING)


def test_a_solution_is_a_guess() -> None:
    solution = full()
    rows: Any = solution.sample("costate", np.array([0.0, 0.5]), 2)
    np.testing.assert_allclose(rows, [[0, 1], [4, 5]])
    with pytest.raises(ProblemError, match="the solution has 2 of u, 1 are needed"):
        solution.sample("u", np.array([0.0]), 1)


# -- success and failure --------------------------------------------------------------


@pytest.mark.parametrize("status", list(Status))
def test_or_raise(status: Status) -> None:
    solution = full().with_(status=status)
    if status.is_success:
        assert solution.or_raise() is solution
    else:
        with pytest.raises(SolverError, match="here and there") as caught:
            solution.or_raise()
        assert status.value in str(caught.value)
        assert "diagnose(solution)" in str(caught.value)
        assert "diagnose(solution)" in repr(solution)


def test_only_two_outcomes_are_a_success() -> None:
    assert {s for s in Status if s.is_success} == {Status.SOLVED, Status.STATIONARY}


def test_repr_is_one_line() -> None:
    text = repr(full())
    assert "pendulum" in text
    assert "ITERATION_LIMIT" in text
    assert "\n" not in text


def test_work_adds_up() -> None:
    assert Work(1, 2, 3) + Work(10, 20, 30) == Work(11, 22, 33)


def test_build_and_solve_are_timed() -> None:
    solution = solve(energy(), MultipleShooting(intervals=5), guess=Guess(u=[1.0]))
    assert solution.build_time > 0.0
    assert solution.solve_time > 0.0
    assert evaluate(solution).cost == pytest.approx(6.25, abs=0.01)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"x": np.zeros((4, 2))}, r"x has shape \(4, 2\), \(5, 2\) is needed"),
        ({"u": np.zeros((5, 2))}, r"u has shape \(5, 2\), \(4, 2\) is needed"),
        ({"control_kind": "linear"}, r"u has shape \(4, 2\), \(5, 2\) is needed"),
        ({"costate": np.zeros((5, 1))}, r"costate has shape \(5, 1\), \(5, 2\)"),
        ({"x0": np.zeros(3)}, r"x0 has shape \(3,\), \(2,\)"),
        ({"t": np.zeros((5, 1))}, r"t has shape \(5, 1\), \(5,\)"),
        ({"x": np.full((5, 2), np.nan)}, "x is not finite"),
        ({"u": np.full((4, 2), np.inf)}, "u is not finite"),
        ({"costate": np.full((5, 2), np.nan)}, "costate is not finite"),
        ({"t": np.array([0.0, 1.0, np.nan, 3.0, 4.0])}, "t is not finite"),
        ({"t": np.array([0.0, 2.0, 1.0, 3.0, 4.0])}, "t does not increase"),
        ({"t": np.zeros(5)}, "t does not increase"),
        ({"cost": np.nan}, "cost is NaN"),
        ({"residual": np.nan}, "residual is NaN"),
    ],
)
def test_refuses(changes: dict, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        full().with_(**changes)


# -- on disk --------------------------------------------------------------------------


def test_save_and_load_keep_every_field(tmp_path: Path) -> None:
    ocp = pendulum()
    solution = full(ocp)
    path = solution.save(tmp_path / "kept")
    assert path == tmp_path / "kept.npz"
    back = Solution.load(path, ocp)
    for field in fields(Solution):
        before, after = getattr(solution, field.name), getattr(back, field.name)
        if field.name in ("history", "parameters"):
            assert set(before) == set(after)
            for key, value in before.items():
                np.testing.assert_array_equal(after[key], value)
        else:
            np.testing.assert_array_equal(after, before)
            assert type(after) is type(before)
    assert evaluate(back).cost == evaluate(solution).cost


@pytest.mark.parametrize("name", ["run.1", "run.npz", "run"])
def test_save_keeps_the_name(tmp_path: Path, name: str) -> None:
    path = full().save(tmp_path / name)
    assert path.name == name.removesuffix(".npz") + ".npz"
    assert path.exists()


def test_load_refuses_another_problem(tmp_path: Path) -> None:
    path = full().save(tmp_path / "s")
    with pytest.raises(ProblemError, match="solves 'pendulum', not 'energy'"):
        Solution.load(path, energy())
    with pytest.raises(ProblemError, match=r"solves another .pendulum.: dynamics, running cost"):
        Solution.load(path, integrator(name="pendulum"))


def test_load_refuses_what_is_no_solution(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", t=np.zeros(3))
    with pytest.raises(ProblemError, match=r"no saved solution: .*costate.* missing"):
        Solution.load(tmp_path / "other.npz", pendulum())
    np.save(tmp_path / "array.npy", np.zeros(3))
    for name, content in (("text.npz", b"once upon a time"), ("empty.npz", b"")):
        (tmp_path / name).write_bytes(content)
    whole = full().save(tmp_path / "whole").read_bytes()
    (tmp_path / "half.npz").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "hurt.npz").write_bytes(whole[:60] + b"?" * 40 + whole[100:])
    for name in ("array.npy", "text.npz", "empty.npz", "half.npz", "hurt.npz"):
        with pytest.raises(ProblemError, match="no saved solution"):
            Solution.load(tmp_path / name, pendulum())


def test_load_refuses_an_unknown_status(tmp_path: Path) -> None:
    path = full().save(tmp_path / "s")
    with np.load(path) as file:
        content: dict[str, Any] = {name: file[name] for name in file.files}
    content["status"] = "PERFECT"
    np.savez(path, **content)
    with pytest.raises(ProblemError, match=r"no saved solution: .*PERFECT"):
        Solution.load(path, pendulum())


@pytest.mark.parametrize("name", ["nowhere.npz", ""])
def test_a_file_that_cannot_be_read_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(ProblemError, match=r"the saved solution .* cannot be read: [NI]") as raised:
        Solution.load(tmp_path / name, pendulum())
    assert isinstance(raised.value.__cause__, OSError)


# -- whether a file belongs to a problem ------------------------------------------------


def moved(**changes: Any) -> OCP:
    """A problem with everything in it that a probe looks at, changed."""
    x, u, k = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("k")
    f = changes.pop("f", lambda x, u: ca.vertcat(x[1], u - ca.sin(x[0])))(x, u)
    ends = changes.pop("ends", 1.0)
    given = {
        "running_cost": u**2 + k * x[0] ** 2,
        "terminal_cost": x[1] ** 2,
        "control_bounds": Box(-2.0, 2.0),
        "state_bounds": Box([-5.0, -np.inf], 5.0),
        "constraints": (
            Constraint("wall", x[0] + u, upper=4.0),
            Constraint("end", x[0], ends, ends, at="terminal"),
        ),
        "horizon": 1.0,
        "x0": [0.0, 0.0],
        "parameters": (Parameter("k", k, 1.0),),
    }
    costs = {name: changes.pop(name)(x, u) for name in list(changes) if name.endswith("cost")}
    model = Model(name="m", x=x, u=u, f=f)
    return OCP(name="moved", model=model, **(given | changes | costs))


def of(problem: OCP) -> Solution:
    t = np.linspace(0.0, 1.0, 5)
    return Solution(
        problem=problem,
        solver="none",
        status=Status.SOLVED,
        t=t,
        x=np.zeros((5, 2)),
        x0=np.zeros(2),
        costate=np.zeros((5, 2)),
        u=np.zeros((4, 1)),
        cost=0.0,
    )


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"f": lambda x, u: ca.vertcat(x[1], u - 1.01 * ca.sin(x[0]))}, "dynamics"),
        ({"running_cost": lambda x, u: u**2}, "running cost"),
        ({"terminal_cost": lambda x, u: 1.001 * x[1] ** 2}, "terminal cost"),
        ({"control_bounds": Box(-2.0, 2.1)}, "control bounds"),
        ({"state_bounds": Box()}, "state bounds"),
        ({"ends": 1.1}, "terminal constraints"),
        ({"constraints": ()}, "path constraints, terminal constraints"),
        ({"horizon": 1.5}, "horizon"),
        ({"horizon": FreeTime(1.0)}, "horizon"),
    ],
)
def test_load_refuses_a_problem_that_says_something_else(
    tmp_path: Path, changes: dict[str, Any], named: str
) -> None:
    path = of(moved()).save(tmp_path / "s")
    with pytest.raises(ProblemError, match=f"solves another 'moved': {named} differ"):
        Solution.load(path, moved(**changes))


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"x0": [0.5, 0.1]},
        {"guess": Guess(u=[1.0])},
        # The same, written in another way.
        {"terminal_cost": lambda x, u: x[1] * x[1] + 0.0 * x[0]},
        {"f": lambda x, u: ca.vertcat(x[1], -ca.cos(x[0] - np.pi / 2) + u)},
    ],
)
def test_load_takes_the_same_problem(tmp_path: Path, changes: dict[str, Any]) -> None:
    problem = moved(**changes)
    path = of(moved()).save(tmp_path / "s")
    assert Solution.load(path, problem).problem is problem


def test_a_probe_may_be_no_number(tmp_path: Path) -> None:
    """The square root is one at the start, and at some of the points not."""
    problem = moved(running_cost=lambda x, u: ca.sqrt(1.0 - 100.0 * ca.sumsqr(x)))
    assert np.isnan(fingerprint(problem)["running cost"]).any()
    assert Solution.load(of(problem).save(tmp_path / "s"), problem).cost == 0.0


def test_a_file_without_a_probe_is_known_by_its_name(tmp_path: Path) -> None:
    path = of(moved()).save(tmp_path / "s")
    with np.load(path) as file:
        content: dict[str, Any] = {n: file[n] for n in file.files if not n.startswith("probe/")}
    np.savez(path, **content)
    assert Solution.load(path, moved(horizon=1.5)).cost == 0.0
