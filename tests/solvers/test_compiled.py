"""Compiled solvers give the answers of interpreted ones."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from ocp import (
    MPC,
    OCP,
    RK4,
    Box,
    Compiler,
    Constraint,
    FreeTime,
    InterpretedWarning,
    Model,
    Solution,
    Status,
)
from ocp.nlp.transcription import Transcription
from solvers import IndirectShooting, MultipleShooting, Schuetz, StagewiseNewton
from tests.mpc.problems import cart
from tests.solvers.problems import mass, tracker

# Iterations stop at their own tolerance; between two runs only rounding differs.
SAME = 1e-9
needs_compiler = pytest.mark.skipif(not Compiler().found, reason="no compiler on this machine")


def swing() -> OCP:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    return OCP(
        name="swing",
        model=Model(name="pendulum", x=x, u=u, f=ca.vertcat(x[1], u - ca.sin(x[0]))),
        x0=[1.0, 0.0],
        horizon=1.0,
        running_cost=x[0] ** 2 + 0.1 * u**2,
        terminal_cost=x[1] ** 2,
    )


def quickest() -> OCP:
    """Bring a cart to rest, with a free final time that the stages depend on."""
    model = mass()
    return OCP(
        name="quickest",
        model=model,
        x0=[1.0, 0.0],
        horizon=FreeTime(guess=2.0, lower=0.5, upper=5.0),
        running_cost=1.0 + model.u**2,
        control_bounds=Box(-5.0, 5.0),
        constraints=(Constraint("rest", model.x, 0.0, 0.0, at="terminal"),),
    )


# Path and terminal constraints, bounds, a free final time, parameters and signals, invariants.
PROBLEMS = [cart(), quickest(), tracker(), arm_scenario("arm-001").ocp()]

SOLVERS = [
    MultipleShooting(10),
    MultipleShooting(10, backend="fatrop"),
    StagewiseNewton(10),
    IndirectShooting(segments=2, steps=20),
    Schuetz(10, gradient="continuous"),
    Schuetz.sound(intervals=10),
]


@pytest.mark.many
@needs_compiler
@pytest.mark.parametrize(
    "solver", SOLVERS, ids=["ipopt", "fatrop", "newton", "indirect", "thesis", "sound"]
)
def test_the_same_answer(solver):
    ocp = swing()
    slow = solver.build(ocp).run()
    fast = replace(solver, compiled=True).build(ocp).run()
    assert fast.status is slow.status
    assert fast.iterations == slow.iterations
    np.testing.assert_allclose(fast.u, slow.u, atol=SAME)
    np.testing.assert_allclose(fast.costate, slow.costate, atol=SAME)


def parts(solution: Solution) -> tuple[np.ndarray, ...]:
    return solution.t, solution.x, solution.u, solution.costate


@pytest.mark.many
@needs_compiler
@pytest.mark.parametrize("ocp", PROBLEMS, ids=lambda ocp: ocp.name)
@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_the_same_iterates_whatever_a_problem_says(ocp, backend):
    slow = MultipleShooting(10, backend=backend, judged=False).build(ocp).run()
    fast = MultipleShooting(10, backend=backend, compiled=True, judged=False).build(ocp).run()
    assert fast.status is slow.status is Status.SOLVED
    assert fast.iterations == slow.iterations
    for one, other in zip(parts(fast), parts(slow), strict=True):
        np.testing.assert_allclose(one, other, atol=SAME)


@needs_compiler
@pytest.mark.parametrize("ocp", PROBLEMS, ids=lambda ocp: ocp.name)
def test_derivatives_of_the_program_are_the_same(ocp):
    def derivatives(fast: bool) -> list[np.ndarray]:
        program = Transcription(ocp, 4, RK4(), fast).program
        lam = ca.MX.sym("lam", program["g"].numel())
        lagrangian = program["f"] + ca.dot(lam, program["g"])
        hessian, gradient = ca.hessian(lagrangian, program["x"])
        jacobian = ca.jacobian(program["g"], program["x"])
        inputs = [program["x"], program["p"], lam]
        function = ca.Function("second", inputs, [gradient, hessian, jacobian])
        rng = np.random.default_rng(0)
        numbers = [rng.uniform(0.5, 1.5, size=function.size_in(i)) for i in range(3)]
        return [np.array(value) for value in function.call(numbers)]

    for one, other in zip(derivatives(True), derivatives(False), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-13)


@needs_compiler
def test_mpc_compiles_unless_told_otherwise():
    ocp, solver = cart(), MultipleShooting(10)
    decisions = [
        MPC(ocp=ocp, solver=solver, dt=0.1, compiled=fast).step([1.0, 0.0], 0.0)
        for fast in (True, False)
    ]
    assert [
        f", compiled={fast}, " in d.plan.solver
        for d, fast in zip(decisions, (True, False), strict=True)
        if d.plan
    ] == [True, True]
    np.testing.assert_allclose(decisions[0].input, decisions[1].input, atol=SAME)


def test_mpc_without_a_compiler_decides_all_the_same(monkeypatch):
    monkeypatch.setenv("CC", "not-a-compiler-at-all")
    with pytest.warns(InterpretedWarning, match="not-a-compiler-at-all") as caught:
        decision = MPC(ocp=cart(), solver=MultipleShooting(10), dt=0.1).step([1.0, 0.0], 0.0)
    assert len([w for w in caught if w.category is InterpretedWarning]) == 1
    assert decision.source.name == "OPTIMAL"
