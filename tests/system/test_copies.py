"""What describes, solves or answers can be copied, and sent to another process."""

import inspect
import multiprocessing
import pickle
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from copy import copy, deepcopy
from dataclasses import fields
from typing import TypeVar

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import solvers
from benchmarks.cases import LIBRARY, Case, arm_cases
from models import Carima
from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    Guess,
    Model,
    Parameter,
    Plant,
    Solution,
    Solver,
    evaluate,
    solve,
)
from ocp.internal import scaled
from ocp.method.least_violating import least_violating
from ocp.problem.fingerprint import fingerprint
from solvers import GPC, MultipleShooting, PrioritisedKinematics
from tests.kinematic.problems import orientation, position
from tests.mpc.problems import cart
from tests.ocp.problems import pendulum
from tests.system.problems import EVERY, in_micrometres

T = TypeVar("T")


def pickled(value: T) -> T:
    return pickle.loads(pickle.dumps(value))


WAYS: tuple[Callable, ...] = (copy, deepcopy, pickled)
each_way = pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
each_solver = pytest.mark.parametrize(
    ("solver", "ocp"), EVERY, ids=[f"{type(s).__name__} {o.name}" for s, o in EVERY]
)


def same_numbers(one: Solution, other: Solution) -> None:
    for name in ("t", "x", "x0", "costate", "u", "breaks"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.status, one.cost, one.message) == (other.status, other.cost, other.message)


# -- descriptions -----------------------------------------------------------------------------


@pytest.mark.many
@pytest.mark.parametrize("case", [*LIBRARY, *arm_cases()[:2]], ids=lambda case: case.name)
@each_way
def test_a_copied_problem_says_the_same(way: Callable, case: Case) -> None:
    ocp = case.build()
    other = way(ocp)
    assert other.describe() == ocp.describe()
    for part, values in fingerprint(ocp).items():
        np.testing.assert_array_equal(fingerprint(other)[part], values)
    np.testing.assert_array_equal(other.x0, ocp.x0)


def test_a_deep_copy_goes_with_the_expressions_of_the_original() -> None:
    ocp = deepcopy(cart())
    x = ocp.model.x
    again = OCP(name="again", model=deepcopy(ocp.model), x0=ocp.x0, horizon=1.0, running_cost=x[0])
    assert again.functions.running_cost([3.0, 0.0], 0.0, 0.0, []) == 3.0


@each_way
def test_copies_have_arrays_that_nobody_writes_to(way: Callable) -> None:
    other = way(pendulum())
    arrays = (other.x0, other.parameters[1].samples, other.control_bounds.lower)
    assert not any(array.flags.writeable for array in arrays)


def test_what_is_pickled_together_shares_its_symbols() -> None:
    ocp = cart()
    model, constraint = pickled((ocp.model, ocp.constraints[0]))
    assert OCP(name="new", model=model, x0=[1, 0], horizon=1.0, constraints=(constraint,))


def test_a_constraint_alone_has_symbols_of_its_own() -> None:
    constraint = pickled(cart().constraints[0])
    assert [symbol.name() for symbol in ca.symvar(constraint.expression)] == ["x_1"]
    with pytest.raises(ValueError, match="x_1"):
        OCP(name="new", model=cart().model, x0=[1, 0], horizon=1.0, constraints=(constraint,))


def test_what_is_derived_is_not_taken_along() -> None:
    ocp = cart()
    size = len(pickle.dumps(ocp))
    solution = solve(ocp, MultipleShooting(10))
    kept = len(pickle.dumps(solution))
    evaluate(solution)
    assert len(pickle.dumps(ocp)) == size
    assert len(pickle.dumps(solution)) == kept


def test_a_scaled_problem_shares_its_time_with_the_original() -> None:
    ocp = scaled(in_micrometres())
    assert ocp is not None
    other = pickled(ocp)
    assert ca.is_equal(other.model.t, other.original.model.t)
    np.testing.assert_array_equal(other.sizes.x, ocp.sizes.x)


@each_way
@pytest.mark.parametrize(
    "value",
    [
        Guess(x=[1.0, 2.0], duration=2.0),
        Parameter("mass", ca.SX.sym("mass"), 2.0),
        Constraint("nothing", ca.SX(0, 1)),
        Constraint("always", ca.SX(1.0), 0.0, 2.0),
        Model(name="fixed", x=ca.SX.sym("x"), u=ca.SX(0, 1), f=ca.SX(0.0)),
    ],
    ids=lambda value: type(value).__name__,
)
def test_parts_of_a_problem(way: Callable, value: object) -> None:
    other = way(value)
    for field in fields(value):  # pyright: ignore[reportArgumentType]
        assert str(getattr(other, field.name)) == str(getattr(value, field.name))


names = st.sampled_from(["x", "y", "x"])
binary = st.sampled_from([ca.plus, ca.times, ca.fmax, ca.atan2])


@st.composite
def expressions(draw: st.DrawFn) -> tuple[ca.SX, list[ca.SX]]:
    """Two expressions of some symbols, of which several may have one name."""
    symbols = [ca.SX.sym(name) for name in draw(st.lists(names, min_size=1, max_size=4))]
    found = [*symbols, ca.SX(draw(st.floats(-3.0, 3.0)))]
    for _ in range(draw(st.integers(0, 12))):
        one, other = (found[draw(st.integers(0, len(found) - 1))] for _ in range(2))
        found.append(draw(binary)(ca.sin(one), other))
    return ca.vertcat(*found[-2:]), symbols


@given(expressions())
def test_symbols_of_one_name_stay_apart(drawn: tuple[ca.SX, list[ca.SX]]) -> None:
    expression, symbols = drawn
    column = ca.vertcat(*symbols)
    parameter, constraint = pickled(
        (Parameter("all", column, np.zeros(len(symbols))), Constraint("c", expression))
    )
    values = np.linspace(-1.0, 2.0, len(symbols))
    here = ca.Function("f", [column], [expression])(values)
    there = ca.Function("f", [parameter.symbol], [constraint.expression])(values)
    np.testing.assert_array_equal(np.array(there), np.array(here))


# -- solvers, programs, solutions -------------------------------------------------------------


def test_every_solver_is_here() -> None:
    public = (getattr(solvers, name) for name in solvers.__all__)
    known = {kind for kind in public if inspect.isclass(kind) and issubclass(kind, Solver)}
    assert {type(solver) for solver, _ in EVERY} == known


@pytest.mark.many
@each_way
@each_solver
def test_a_copied_program_finds_the_same(way: Callable, solver: Solver, ocp: OCP) -> None:
    assert way(solver) == solver
    program = solver.build(ocp)
    first = program.run()
    assert first.status.is_success or first.status.name == "MYOPIC", first.message
    same_numbers(way(program).run(), first)


@pytest.mark.many
@each_way
@each_solver
def test_a_copied_solution_is_worth_the_same(way: Callable, solver: Solver, ocp: OCP) -> None:
    solution = solve(ocp, solver)
    other = way(solution)
    same_numbers(other, solution)
    here, there = evaluate(solution), evaluate(other)
    assert (there.cost, there.violation) == (here.cost, here.violation)
    np.testing.assert_array_equal(other.control(0.3), solution.control(0.3))


@each_way
def test_the_program_of_least_violation(way: Callable) -> None:
    program = least_violating(MultipleShooting(10), cart())
    assert program is not None
    same_numbers(way(program).run(), program.run())


@each_way
def test_kinematics(way: Callable) -> None:
    first = PrioritisedKinematics((position(), orientation()))
    motion = {"duration": 0.1, "dt": 0.01}
    want = first.build().run([0.3, 0.5, -0.4, 0.2], **motion).q
    for program in (way(first).build(), way(first.build())):
        np.testing.assert_array_equal(program.run([0.3, 0.5, -0.4, 0.2], **motion).q, want)


@each_way
def test_a_law_whose_backend_has_run(way: Callable) -> None:
    model = Carima([1.0, -0.8], [0.4, 0.6])
    law = GPC(5, weight=0.1, input_bounds=Box(-0.2, 0.2)).build(model)
    given = [0.0, 0.0], [0.0, 0.0], 1.0
    want = law.step(*given)
    assert want.increment == pytest.approx(0.2)
    np.testing.assert_allclose(way(law).step(*given).increments, want.increments, atol=1e-7)


# -- the loop ---------------------------------------------------------------------------------


@pytest.mark.many
@each_way
@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_a_copied_controller_goes_on_where_the_original_was(way: Callable, delay: float) -> None:
    mpc = MPC(ocp=cart(), solver=MultipleShooting(10), dt=0.1, delay=delay, compiled=False)
    mpc.reset([0.0])
    for k in range(3):
        mpc.step([1.0 - 0.01 * k, 0.0], 0.1 * k)
    other = way(mpc)
    for k in range(3, 6):
        here, there = (each.step([0.9, -0.1], 0.1 * k) for each in (mpc, other))
        np.testing.assert_array_equal(there.input, here.input)
        assert (there.source, there.age) == (here.source, here.age)
    mpc.step([0.5, 0.0], 0.6)
    assert other.state.plan is not mpc.state.plan, "and from there on they are two"


@pytest.mark.many
@each_way
def test_a_rollout_with_its_plans(way: Callable) -> None:
    mpc = MPC(ocp=cart(), solver=MultipleShooting(10), dt=0.1, compiled=False)
    rollout = mpc.run(way(Plant(ocp=cart())), [1.0, 0.0], 0.3)
    other = way(rollout)
    np.testing.assert_array_equal(other.x, rollout.x)
    assert other.cost == rollout.cost
    for one, again in zip(rollout.decisions, other.decisions, strict=True):
        assert one.plan is not None
        assert again.plan is not None
        same_numbers(again.plan, one.plan)


# -- other processes --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def spawned() -> Iterator[Executor]:
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as executor:
        yield executor


def first_input(mpc: MPC) -> np.ndarray:
    return mpc.step(mpc.ocp.x0, 0.0).input


def test_a_spawned_process_solves_and_answers(spawned: Executor) -> None:
    ocp, solver = cart(), MultipleShooting(10)
    here = solve(ocp, solver)
    program, mpc = solver.build(ocp), MPC(ocp=ocp, solver=solver, dt=0.1, compiled=False)
    same_numbers(spawned.submit(solve, ocp, solver).result(), here)
    same_numbers(spawned.submit(program.run).result(), here)
    assert spawned.submit(evaluate, here).result().cost == evaluate(here).cost
    np.testing.assert_array_equal(spawned.submit(first_input, mpc).result(), first_input(mpc))


@pytest.mark.slow
def test_loky_takes_laws_that_are_written_in_place() -> None:
    joblib = pytest.importorskip("joblib")
    mpc = MPC(
        ocp=pendulum(),
        solver=MultipleShooting(6),
        dt=0.25,
        parameters=lambda t: {"gain": 0.8 + t},
        backup=lambda x, t: [0.0, 0.0],
        compiled=False,
    )
    (there,) = joblib.Parallel(n_jobs=2)([joblib.delayed(first_input)(mpc)])
    np.testing.assert_array_equal(there, first_input(mpc))


@pytest.mark.slow
def test_dask_solves_and_answers() -> None:
    distributed = pytest.importorskip("distributed")
    ocp = cart()
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as c,
        distributed.Client(c) as client,
    ):
        there = client.get_executor().submit(solve, ocp, MultipleShooting(10)).result()
    same_numbers(there, solve(ocp, MultipleShooting(10)))
