"""The native backend of multiple shooting against IPOPT on the same program, and its failures."""

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import all_cases
from models import cart_pole_upright
from ocp import (
    MPC,
    OCP,
    Constraint,
    Guess,
    InputSource,
    InterpretedWarning,
    Model,
    Plant,
    Radau,
    Status,
    Table,
    UnsupportedProblem,
    evaluate,
    solve,
)
from ocp.internal import Transcription, Unbuildable
from solvers import MultipleShooting, multistart, solve_many
from solvers.direct.native import lane_code, native_library, native_solve
from solvers.direct.native.native_library import NativeLibrary
from solvers.direct.native.stage_code import StageCode
from tests.native.problems import (
    designed,
    free_time,
    held_still,
    impossible,
    rationed,
    swing,
    unbounded,
)

NATIVE = MultipleShooting(20, backend="native")
IPOPT = MultipleShooting(20)
# Two interior points on the same program: each stops where its own barrier is 1e-9 or less.
SAME_OPTIMUM = 1e-8
SAME_COSTATE = 1e-5


@pytest.mark.many
@pytest.mark.parametrize("make", [swing, free_time, designed, held_still])
def test_it_finds_the_optimum_of_ipopt(make) -> None:
    ocp = make()
    native, ipopt = solve(ocp, NATIVE).or_raise(), solve(ocp, IPOPT).or_raise()
    assert "IPOPT" not in native.message
    assert native.cost == pytest.approx(ipopt.cost, rel=SAME_OPTIMUM, abs=SAME_OPTIMUM)
    np.testing.assert_allclose(native.x, ipopt.x, atol=1e-4)
    scale = 1.0 + np.abs(ipopt.costate).max()
    np.testing.assert_allclose(native.costate, ipopt.costate, atol=SAME_COSTATE * scale)
    found, known = evaluate(native).violation, evaluate(ipopt).violation
    assert found == pytest.approx(known, abs=1e-5)  # of both between the nodes


def test_parameters_start_and_time_are_those_of_the_run() -> None:
    ocp = swing()
    given = {"parameters": {"stiffness": 0.7, "wind": [0.1, 0.2, -0.1, 0.3]}, "t0": 0.4}
    native, ipopt = (s.build(ocp).run(x0=[0.5, 0.2], **given) for s in (NATIVE, IPOPT))
    assert "IPOPT" not in native.message
    assert native.or_raise().cost == pytest.approx(ipopt.or_raise().cost, rel=SAME_OPTIMUM)


def test_a_warm_start_takes_fewer_iterations() -> None:
    program = NATIVE.build(swing())
    cold = program.run().or_raise()
    warm = program.run(guess=cold).or_raise()
    assert "IPOPT" not in cold.message + warm.message
    assert warm.cost == pytest.approx(cold.cost, rel=SAME_OPTIMUM)
    assert warm.iterations < cold.iterations


def test_an_infeasible_problem_is_called_so() -> None:
    solution = solve(impossible(), NATIVE)
    assert solution.status is Status.INFEASIBLE
    assert "goal" in solution.message


def test_no_minimum_is_no_success() -> None:
    assert solve(unbounded(), NATIVE).status is Status.DIVERGED


def test_after_a_failure_the_next_run_is_as_the_first() -> None:
    program = replace(NATIVE, feasibility_restoration=False).build(swing())
    first = program.run().or_raise()
    failed = program.run(parameters={"stiffness": 1e6})
    assert not failed.status.is_success
    again = program.run()
    np.testing.assert_array_equal(again.x, first.x)
    assert again.iterations == first.iterations


def test_a_guess_far_away_is_no_success_of_something_else() -> None:
    guess = Guess(x=np.full((21, 2), 1e8), u=np.full((20, 2), -1e8))
    solution = solve(swing(), NATIVE, guess=guess)
    assert not solution.status.is_success or solution.cost == pytest.approx(
        solve(swing(), IPOPT).cost, rel=1e-6
    )


def test_a_time_limit_ends_it() -> None:
    ocp = swing()
    solution = solve(ocp, replace(NATIVE, time_limit=1e-9, feasibility_restoration=False))
    assert solution.status is Status.TIME_LIMIT
    assert np.isfinite(solution.x).all()


def test_an_iteration_limit_ends_it() -> None:
    limited = replace(NATIVE, max_iterations=2, feasibility_restoration=False)
    assert solve(swing(), limited).status is Status.ITERATION_LIMIT


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> str:
    """A machine without one, of another name in each test, for a reason is told once."""
    name = f"no-compiler-of-{request.node.name}"
    monkeypatch.setenv("CC", name)
    return name


def test_without_a_compiler_ipopt_solves_it_with_one_warning(no_compiler: str) -> None:
    with pytest.warns(InterpretedWarning, match=f"no compiler '{no_compiler}'") as caught:
        found = [solve(ocp, NATIVE).or_raise() for ocp in (swing(), free_time())]
    assert len([w for w in caught if w.category is InterpretedWarning]) == 1
    for solution in found:
        assert "by IPOPT, since the native solver could not be compiled" in solution.message
        assert "backend='ipopt'" in solution.solver
    np.testing.assert_allclose(found[0].u, solve(swing(), IPOPT).u, atol=1e-6)


def test_what_fails_without_a_compiler_is_told_as_by_ipopt(no_compiler: str) -> None:
    with pytest.warns(InterpretedWarning, match=no_compiler):
        found = solve(impossible(), NATIVE)
    assert found.status is Status.INFEASIBLE
    assert solve(impossible(), IPOPT).message in found.message


def test_many_runs_and_starts_do_without_a_compiler(no_compiler: str) -> None:
    with pytest.warns(InterpretedWarning, match=no_compiler):
        found = solve_many(rationed(), NATIVE, x0=[[0.0, 0.4], [0.1, 0.3]])
    assert found.in_c == 0
    assert found.solved.all()
    assert len(multistart(rationed(), NATIVE, 2, 0, violation=1.0)) == 1


def test_a_loop_without_a_compiler_solves_every_step(no_compiler: str) -> None:
    with pytest.warns(InterpretedWarning, match=no_compiler) as caught:
        mpc = MPC(ocp=rationed(), solver=NATIVE, dt=0.05, real_time=True)
    first = mpc.step([0.0, 0.4], 0.0)
    assert not mpc.prepare_next()
    second = mpc.step([0.02, 0.42], 0.05)
    assert len([w for w in caught if w.category is InterpretedWarning]) == 1
    assert first.source is second.source is InputSource.OPTIMAL


def test_the_optimum_costs_the_same_in_machine_code_of_another_horizon() -> None:
    ocp: OCP = free_time()
    for n in (5, 40):
        native, ipopt = (solve(ocp, replace(s, intervals=n)) for s in (NATIVE, IPOPT))
        assert "IPOPT" not in native.message
        assert native.or_raise().cost == pytest.approx(ipopt.or_raise().cost, rel=SAME_OPTIMUM)


def test_a_pause_after_every_iteration_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    program = NATIVE.build(swing())
    whole = program.run().or_raise()
    monkeypatch.setattr(native_solve, "_PAUSE", 0.0)
    paused = program.run().or_raise()
    np.testing.assert_array_equal(paused.x, whole.x)
    np.testing.assert_array_equal(paused.history["cost"], whole.history["cost"])
    assert paused.iterations == whole.iterations > 3


@pytest.mark.parametrize("n", [1, 3, 6])
def test_lanes_that_are_left_over_are_no_stages(n: int) -> None:
    native, ipopt = (solve(rationed(), replace(s, intervals=n)) for s in (NATIVE, IPOPT))
    assert "IPOPT" not in native.message
    assert native.or_raise().cost == pytest.approx(ipopt.or_raise().cost, rel=SAME_OPTIMUM)
    np.testing.assert_allclose(native.u, ipopt.u, atol=1e-5)


def test_blocks_are_refused_by_name() -> None:
    solver = MultipleShooting(8, backend="native", blocks=(1, 2, 2))
    with pytest.raises(UnsupportedProblem, match="swing: the native backend takes no blocks"):
        solver.build(swing())


def test_what_cannot_be_written_as_c_is_refused_by_name() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    model = Model(name="mass", x=x, u=u, f=u - ca.erfinv(0.1 * x))
    ocp = OCP(name="drawn", model=model, x0=[1.0], horizon=1.0, running_cost=u**2)
    with pytest.raises(UnsupportedProblem, match="drawn: the native backend cannot write"):
        NATIVE.build(ocp)
    with pytest.raises(UnsupportedProblem, match="explicit integrators, not Radau"):
        replace(NATIVE, integrator=Radau()).build(swing())


def called() -> OCP:
    """A mass in drag that is a table, whose cost is a root."""
    x, u, z = (ca.SX.sym(name) for name in ("x", "u", "z"))
    places = np.linspace(-5.0, 5.0, 12)
    drag = Table(places, 0.1 * places**2, beyond="extend", name="drag")
    model = Model(
        name="mass", x=x, u=u, z=z, f=u - drag(x), algebraic=ca.exp(z) + z - x - 2.0, z_guess=1.0
    )
    return OCP(
        name="called",
        model=model,
        x0=[1.0],
        horizon=1.0,
        running_cost=u**2 + z**2,
        constraints=(Constraint("there", x, 0.2, 0.2, at="terminal"),),
        smoothness=1,
    )


def test_tables_and_roots_are_called() -> None:
    ocp = called()
    found, right = (
        solve(ocp, solver).or_raise() for solver in (NATIVE, replace(NATIVE, backend="ipopt"))
    )
    assert found.cost == pytest.approx(right.cost, rel=1e-8)
    np.testing.assert_allclose(found.u, right.u, atol=1e-6)
    np.testing.assert_allclose(found.costate, right.costate, atol=1e-6)
    assert "IPOPT" not in found.message


def test_a_start_that_is_data_is_refused_by_name() -> None:
    transcription = Transcription(swing(), 8, NATIVE.integrator, start_as_data=True)
    with pytest.raises(UnsupportedProblem, match="takes no start that is data"):
        NATIVE.nlp_backend.build(transcription)


def test_a_mistake_of_the_compiler_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(lane_code._OPERATORS, ca.OP_SIN, "lanes_cos({0})")
    with pytest.raises(Unbuildable, match="gives other numbers than CasADi"):
        NativeLibrary.of(StageCode(Transcription(swing(), 7, NATIVE.integrator)))


@pytest.mark.parametrize("order", [0, 1, 2])
def test_a_mistake_in_any_function_and_lane_is_noticed(order: int) -> None:
    library = NativeLibrary.of(StageCode(Transcription(swing(), 6, NATIVE.integrator)))
    touched = (library.arrays.v, library.arrays.c_slope, library.arrays.hessian)[order]
    for place in (0, touched.shape[0] // 2, touched.shape[0] - 1):

        def wrong(up_to: int, place: int = place) -> float:
            cost = library.evaluate(up_to)
            if up_to == order:
                touched[place] += 1.0
            return cost

        code, at = library.code, library.arrays
        found = native_library.first_difference(code, at, wrong, library.account)
        assert found is not None
        assert found.endswith(f"at order {order}")


def test_a_mistake_in_a_half_step_is_noticed() -> None:
    library = NativeLibrary.of(StageCode(Transcription(swing(), 6, NATIVE.integrator)))

    def wrong() -> None:
        library.account()
        library.arrays.half_step[5] += 1.0

    given = library.code, library.arrays, library.evaluate
    assert native_library.first_difference(*given, library.account) is None
    assert native_library.first_difference(*given, wrong) == "the half step"


def test_a_library_that_cannot_be_loaded_is_a_named_warning(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    broken = tmp_path / "broken.so"
    broken.write_text("no machine code")
    monkeypatch.setattr(native_library, "built_library", lambda *_: broken)
    with pytest.warns(InterpretedWarning, match=r"swing: .* cannot be loaded"):
        assert "by IPOPT" in solve(swing(), NATIVE).or_raise().message


@pytest.mark.slow
def test_a_control_loop_acts_as_with_ipopt() -> None:
    ocp = cart_pole_upright()
    start = np.array([0.0, np.pi - 0.3, 0.0, 0.0])
    loops = [
        MPC(ocp=ocp, solver=solver, dt=0.05, compiled=False).run(Plant(ocp=ocp), start, 0.15)
        for solver in (NATIVE, IPOPT)
    ]
    assert set(loops[0].sources) == {InputSource.OPTIMAL}
    np.testing.assert_allclose(loops[0].x, loops[1].x, atol=1e-5)


# What ends elsewhere at 20 intervals: in another local minimum, or without a success of either.
ELSEWHERE = (
    "cart-pole-swing-up", "hypersensitive", "linear-hypersensitive", "hang-glider",
    "periodic-algae",
)  # fmt: skip
# What the native solver hands over at 20 intervals.
BY_IPOPT: tuple[str, ...] = ("methanol",)
LIBRARY = [
    case
    for case in all_cases()
    if not case.name.startswith(("arm-", "compare-")) and case.name not in ELSEWHERE
]


@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize("case", LIBRARY, ids=lambda case: case.name)
def test_it_finds_the_optimum_of_ipopt_in_the_library(case) -> None:
    ocp = case.build()
    if len({float(t) for m in ocp.data for t in np.asarray(m.times)}) >= 20:
        pytest.skip("it has more instants of data than this grid has intervals")
    native, ipopt = (solve(ocp, solver) for solver in (NATIVE, IPOPT))
    assert "IPOPT" not in native.message or case.name in BY_IPOPT
    assert native.status is ipopt.status
    assert native.cost == pytest.approx(ipopt.cost, rel=1e-6, abs=1e-6)
