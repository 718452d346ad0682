"""Problems whose dynamics call tables, networks and foreign functions, by every method."""

import pickle
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    Model,
    Network,
    Plant,
    ProblemError,
    Solver,
    Status,
    Table,
    UnsupportedProblem,
    costates_along,
    evaluate,
    minimum_principle,
    solve,
)
from solvers import (
    Collocation,
    GridDP,
    IndirectShooting,
    LinearMPC,
    MultipleShooting,
    Schuetz,
    StagewiseNewton,
    certify,
    diagnose,
    polish,
)
from tests.ocp.network_file import HIDDEN, OUTPUT, network_file
from tests.solvers.foreign_functions import Python, drag, library
from tests.tolerances import SAME_PROGRAM

POSITION, VELOCITY, FORCE = (ca.SX.sym(name) for name in ("position", "velocity", "force"))
END = ca.DM([1, 0])


def pushed(resistance: ca.SX, **changes: Any) -> OCP:
    """Return a mass that is brought to rest at 1 m."""
    x = ca.vertcat(POSITION, VELOCITY)
    model = Model(name="mass", x=x, u=FORCE, f=ca.vertcat(VELOCITY, FORCE - resistance))
    given: dict[str, Any] = {
        "constraints": (Constraint("arrival", x, [1, 0], [1, 0], at="terminal"),)
    }
    return OCP(
        name="pushed",
        model=model,
        x0=[0, 0],
        horizon=1.0,
        running_cost=FORCE**2 / 2,
        **(given | changes),
    )


def with_free_end(ocp: OCP) -> OCP:
    """Return it with a price on where it ends, for methods that take no constraints."""
    return replace(ocp, constraints=(), terminal_cost=50 * ca.sumsqr(ocp.model.x - END))


def of_place(x: Any) -> Any:
    """Return a resistance that depends on the position."""
    return ca.sin(3 * x)


def of_place_and_speed(x: Any, v: Any) -> Any:
    """Return one that depends on the velocity too."""
    return ca.sin(3 * x) * (1 + v * v / 4)


@cache
def table(beyond: Any = "refuse", end: float = 1.3) -> Table:
    """Return the first as a table of 1000 knots."""
    knots = np.linspace(-0.1, end, 1000)
    return Table(knots, np.sin(3 * knots), beyond, name="lift")


@cache
def surface() -> Table:
    """Return the second as one of 50 x 50."""
    x, v = np.linspace(-0.5, 1.5, 50), np.linspace(-0.5, 2.5, 50)
    return Table((x, v), np.sin(3 * x)[:, None] * (1 + v**2 / 4), "extend", name="surface")


# What is called, and the same as a formula.
PROBLEMS = {
    "table": (pushed(table()(POSITION)), pushed(of_place(POSITION))),
    "surface": (
        pushed(surface()(POSITION, VELOCITY)),
        pushed(of_place_and_speed(POSITION, VELOCITY)),
    ),
}
DIRECT = [
    MultipleShooting(30),
    MultipleShooting(30, backend="fatrop"),
    MultipleShooting(30, backend="fatrop", time_limit=60.0),
    MultipleShooting(30, compiled=True),
    Collocation(10),
]
UNCONSTRAINED = [
    StagewiseNewton(30),
    StagewiseNewton(30, compiled=True),
    Schuetz.sound(intervals=30),
    IndirectShooting(5),
]


def _takes_long(solver: Solver) -> bool:
    return isinstance(solver, IndirectShooting) or "compiled=True" in repr(solver)


def every(solvers: list[Any]) -> list[Any]:
    """Return every problem with every solver; the larger table takes its time."""
    return [
        pytest.param(
            name,
            solver,
            id=f"{name}-{solver}",
            marks=[pytest.mark.slow] * (name == "surface" and _takes_long(solver)),
        )
        for name in PROBLEMS
        for solver in solvers
    ]


@pytest.mark.many
@pytest.mark.parametrize(("name", "solver"), every(DIRECT))
def test_a_direct_method_solves_it_as_the_formula(name: str, solver: Solver) -> None:
    called, written = PROBLEMS[name]
    found, expected = solve(called, solver), solve(written, solver)
    assert found.status is Status.SOLVED
    # The surface is 1e-7 from its formula.
    assert found.cost == pytest.approx(expected.cost, rel=1e-6)
    assert evaluate(found).cost == pytest.approx(evaluate(expected).cost, rel=1e-6)


@pytest.mark.many
@pytest.mark.parametrize(("name", "solver"), every(UNCONSTRAINED))
def test_a_method_without_constraints_as_well(name: str, solver: Solver) -> None:
    called, written = (with_free_end(each) for each in PROBLEMS[name])
    found, expected = solve(called, solver), solve(written, solver)
    assert found.status.is_success
    assert found.cost == pytest.approx(expected.cost, rel=1e-6)


@pytest.mark.parametrize("name", ["table", pytest.param("surface", marks=pytest.mark.slow)])
def test_direct_and_indirect_agree_on_cost_and_costates(name: str) -> None:
    direct = solve(PROBLEMS[name][0], Collocation(20))
    exact = polish(direct)
    assert exact.status.is_success
    assert exact.cost == pytest.approx(direct.cost, rel=1e-7)
    np.testing.assert_allclose(exact.costate[0], direct.costate[0], rtol=1e-5)
    again = costates_along(exact)
    np.testing.assert_allclose(again.costate[0], exact.costate[0], rtol=1e-5)
    assert (evaluate(exact).stationarity or 0.0) < 1e-6


@pytest.mark.slow
def test_a_table_is_certified() -> None:
    certificate = certify(solve(PROBLEMS["table"][0], MultipleShooting(30)))
    assert certificate.holds, str(certificate)


@pytest.mark.parametrize("solver", [MultipleShooting(30), MultipleShooting(30, compiled=True)])
def test_a_network_is_its_weights(solver: Solver, tmp_path: Path) -> None:
    x = ca.vertcat(POSITION, VELOCITY)
    network = Network(network_file(tmp_path / "drag.onnx"))
    written = ca.DM(OUTPUT) @ ca.tanh(ca.DM(HIDDEN) @ x)
    found, expected = solve(pushed(network(x)), solver), solve(pushed(written), solver)
    assert found.status is Status.SOLVED
    assert found.cost == pytest.approx(expected.cost, rel=SAME_PROGRAM)


def test_costs_constraints_and_a_control_loop_take_tables() -> None:
    ocp = with_free_end(pushed(table("extend")(POSITION), control_bounds=Box(-20, 20)))
    price = Table(np.linspace(-20, 20, 41), np.linspace(-20, 20, 41) ** 2, "extend")
    fast = Table(np.linspace(-1, 4, 21), np.linspace(-1, 4, 21) ** 2, "extend")
    limit = Constraint("speed", fast(VELOCITY), upper=1.2**2)
    ocp = replace(ocp, running_cost=price(FORCE) / 2, constraints=(limit,))
    found = solve(ocp, Collocation(10))
    assert found.status is Status.SOLVED
    assert evaluate(found).violation < 1e-2
    assert np.abs(found.x[:, 1]).max() == pytest.approx(1.2, abs=1e-2)
    loop = MPC(ocp=ocp, solver=MultipleShooting(10), dt=0.1, compiled=False)
    assert loop.run(Plant(ocp=ocp), x0=[0.1, 0.0], duration=0.3).ended == ""


# -- beyond the ends ------------------------------------------------------------------


@pytest.mark.parametrize(
    "solver",
    [
        MultipleShooting(10, feasibility_restoration=False, max_iterations=60),
        MultipleShooting(10, backend="fatrop", feasibility_restoration=False),
        IndirectShooting(5),
    ],
    ids=repr,
)
def test_a_trajectory_that_has_to_leave_a_table_is_a_failure_that_names_it(solver: Solver) -> None:
    found = solve(pushed(table(end=0.5)(POSITION)), solver)
    assert not found.status.is_success
    assert "lift" in found.message
    assert "beyond='extend'" in found.message


def test_the_referee_names_the_table_that_a_trajectory_leaves() -> None:
    found = solve(PROBLEMS["table"][1], MultipleShooting(30))
    narrow = found.with_(problem=pushed(table(end=0.8)(POSITION)))
    verdict = evaluate(narrow)
    assert verdict.cost == np.inf
    assert "table lift(0." in verdict.worst
    assert "t = 0." in verdict.worst


def test_the_diagnosis_names_it() -> None:
    ocp = with_free_end(pushed(table(end=0.5)(POSITION)))
    guess = solve(PROBLEMS["table"][1], MultipleShooting(10))
    said = str(diagnose(replace(ocp, guess=guess)))
    assert "table lift(" in said


def test_the_diagnosis_sees_the_kinks_at_the_ends() -> None:
    ocp = with_free_end(pushed(table("clamp", 0.8)(POSITION)))
    found = solve(ocp, MultipleShooting(10))
    assert "has a kink" in str(diagnose(found))


# -- foreign functions ------------------------------------------------------------------


@pytest.fixture(scope="module")
def external(tmp_path_factory: pytest.TempPathFactory) -> ca.Function:
    return library(tmp_path_factory.mktemp("library"))


@pytest.mark.parametrize("solver", [DIRECT[0], DIRECT[2], DIRECT[4], IndirectShooting(5)], ids=repr)
def test_a_function_of_a_library(solver: Solver, external: ca.Function) -> None:
    found, expected = (
        solve(pushed(resistance), solver) for resistance in (external(VELOCITY), drag(VELOCITY))
    )
    assert found.status.is_success
    assert found.cost == pytest.approx(expected.cost, rel=SAME_PROGRAM)


def test_a_function_of_python() -> None:
    python = Python()
    found = solve(pushed(python(VELOCITY)), MultipleShooting(5))
    expected = solve(pushed(drag(VELOCITY)), MultipleShooting(5))
    assert found.status is Status.SOLVED
    assert found.cost == pytest.approx(expected.cost, rel=SAME_PROGRAM)


@pytest.mark.parametrize(
    "solver",
    [
        MultipleShooting(10, compiled=True),
        StagewiseNewton(10, compiled=True),
        IndirectShooting(5, compiled=True),
        Schuetz(10, compiled=True),
    ],
    ids=repr,
)
@pytest.mark.parametrize("kind", ["library", "python"])
def test_no_machine_code_calls_them(solver: Solver, kind: str, external: ca.Function) -> None:
    function = external if kind == "library" else Python()
    with pytest.raises(UnsupportedProblem, match=r"where 'drag', .*: take compiled=False"):
        solver.build(with_free_end(pushed(function(VELOCITY))))


def test_no_other_process_calls_python() -> None:
    python = Python()
    ocp = pushed(python(VELOCITY))
    solver = MultipleShooting(10, backend="fatrop", time_limit=10.0)
    with pytest.raises(UnsupportedProblem, match="which cannot call 'drag', a Python callback"):
        solver.build(ocp)
    with pytest.raises(ProblemError, match="'drag', a Python callback"):
        pickle.dumps(ocp)


@pytest.mark.parametrize("solver", [*DIRECT[:2], Collocation(5), IndirectShooting(5)], ids=repr)
@pytest.mark.parametrize("kind", ["library", "python"])
def test_derivatives_that_are_not_there(solver: Solver, kind: str, tmp_path: Path) -> None:
    is_library = kind == "library"
    without = library(tmp_path, order=1) if is_library else Python(differences=False)
    ocp = pushed(without(VELOCITY))
    with pytest.raises(UnsupportedProblem, match="second derivatives, which the function 'drag'"):
        solver.build(ocp)


@pytest.mark.parametrize("solver", [GridDP((101,), (21,)), Schuetz.sound()], ids=type)
def test_a_method_of_first_order_takes_those_without_second(solver: Solver, tmp_path: Path) -> None:
    x, u, called = ca.SX.sym("x"), ca.SX.sym("u"), library(tmp_path, order=1)
    ocp = OCP(
        name="slowed",
        model=Model(name="slowed", x=x, u=u, f=x + 0.1 * (u - called(x)), dt=0.1),
        x0=[1.0],
        horizon=3,
        running_cost=u**2 + x**2,
        control_bounds=Box(-1, 1),
        state_bounds=Box(-2, 2) if isinstance(solver, GridDP) else Box(),
    )
    found = solve(ocp, solver)
    assert found.status.is_success
    assert evaluate(found).stationarity is None
    without = replace(ocp.model, f=x - library(tmp_path, order=0)(x) + u)
    with pytest.raises(UnsupportedProblem, match=r"needs first derivatives, which .* 'drag'"):
        solver.build(replace(ocp, model=without))


def test_a_linear_method_says_that_a_table_is_no_line() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    model = Model(name="m", x=x, u=u, f=table()(x) + u, dt=0.1)
    ocp = OCP(name="m", model=model, x0=[0.1], horizon=3, running_cost=u**2)
    with pytest.raises(UnsupportedProblem, match="lift"):
        LinearMPC().build(ocp)


def squared(u: ca.SX) -> ca.SX:
    """Return u^2 / 2, called: its curvature contains u, and does not depend on it."""
    given = ca.MX.sym("u")
    return ca.Function("squared", [given], [given**2 / 2], {"never_inline": True})(u)


def test_a_called_cost_of_the_control_has_a_minimiser() -> None:
    written = pushed(of_place(POSITION))
    ocp = replace(written, running_cost=squared(FORCE))
    control = minimum_principle(ocp).control
    assert float(control([0.3, 0.1], [1.0, -2.0], 0.0, [])) == pytest.approx(2.0)  # type: ignore


@pytest.mark.slow
def test_the_control_may_stand_in_a_function_of_a_library(external: ca.Function) -> None:
    ocp = pushed(-0.1 * external(FORCE))
    found = solve(ocp, IndirectShooting(5, steps=60))
    assert found.status.is_success
    assert found.cost == pytest.approx(solve(ocp, Collocation(10)).cost, rel=1e-5)
