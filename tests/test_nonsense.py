"""What a stranger passes by mistake is refused by name, before it does anything."""

# Arguments of the wrong type are what this file is about:
# pyright: reportArgumentType=false, reportCallIssue=false

from collections.abc import Callable
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest

from models import (
    Carima,
    CartPole,
    Disc,
    cart_pole_swing_up,
    discrete_double_integrator,
    goddard,
    random_scenarios,
    van_der_pol,
)
from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    FreeTime,
    Guess,
    Model,
    Plant,
    ProblemError,
    Solution,
    Status,
    Transcription,
    costates_along,
    derive,
    discretise,
    evaluate,
    hamiltonian,
    instantaneous,
    linear_quadratic,
    solve,
)
from solvers import (
    GPC,
    Armijo,
    AugmentedLagrangian,
    Axis,
    BetweenNodes,
    Collocation,
    Effort,
    FixedStep,
    Greedy,
    GridDP,
    HorizonContinuation,
    IndirectShooting,
    MultipleShooting,
    ParameterContinuation,
    ReverseShooting,
    Schuetz,
    StagewiseNewton,
    certify,
    multistart,
    refined,
)


@cache
def problem() -> Any:
    return van_der_pol()


@cache
def answer() -> Any:
    return solve(problem(), MultipleShooting(10))


@cache
def mesh() -> Any:
    return refined(answer())


def run(**data: Any) -> Solution:
    return MultipleShooting(10).build(problem()).run(**data)


def point(**changes: Any) -> OCP:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    model = Model(name="point", x=x, u=u, f=ca.vertcat(x[1], u))
    given: dict[str, Any] = {"name": "point", "model": model, "x0": [0.0, 0.0], "horizon": 1.0}
    return OCP(**(given | {"running_cost": u**2} | changes))


def dynamics(**changes: Any) -> Model:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    given: dict[str, Any] = {"name": "point", "x": x, "u": u, "f": ca.vertcat(x[1], u)}
    return Model(**(given | changes))


Wrong = Callable[[], Any]
ANY: Any = MultipleShooting  # a class where an instance is needed

CALLS: list[tuple[str, Wrong]] = [
    # Functions of a solution.
    ("evaluate: solution is a Refinement, Solution is needed: its .solution is one",
     lambda: evaluate(mesh())),
    ("evaluate: solution is a OCP, Solution is needed$", lambda: evaluate(problem())),
    ("evaluate: solution is a NoneType", lambda: evaluate(*[None])),
    ("evaluate: tolerance = 0.0, it must be positive", lambda: evaluate(answer(), tolerance=0.0)),
    ("evaluate: tolerance = nan", lambda: evaluate(answer(), tolerance=np.nan)),
    ("evaluate: tolerance = 'tight'", lambda: evaluate(answer(), **{"tolerance": "tight"})),
    ("costates_along: solution is a OCP", lambda: costates_along(problem())),
    ("certify: solution is a OCP", lambda: certify(problem())),
    ("certify: effort is a int", lambda: certify(answer(), *[3])),
    ("refined: start is a OCP", lambda: refined(problem())),
    ("refined: solver is a MultipleShooting", lambda: refined(answer(), solver=ANY())),
    ("refined: accuracy = 'x'", lambda: refined(answer(), **{"accuracy": "x"})),
    # Functions of a problem and a solver.
    (r"solve: solver is the class MultipleShooting, Solver is needed: write MultipleShooting\(",
     lambda: solve(problem(), ANY)),
    ("solve: solver is a str", lambda: solve(problem(), *["ipopt"])),
    ("solve: ocp is a MultipleShooting", lambda: solve(ANY(), problem())),
    ("multistart: ocp is a str", lambda: multistart(*["x"], ANY(), 2, 0)),
    ("multistart: solver is the class", lambda: multistart(problem(), ANY, 2, 0)),
    ("multistart: starts must be a whole", lambda: multistart(problem(), ANY(), 0, 0)),
    ("multistart: seed must be a whole number of at least 0, not -1",
     lambda: multistart(problem(), ANY(), 2, -1)),
    ("multistart: seed", lambda: multistart(problem(), ANY(), 2, *["a"])),
    ("multistart: amplitude", lambda: multistart(problem(), ANY(), 2, 0, amplitude=np.nan)),
    ("MPC of Van der Pol: dt .* = 'fast'",
     lambda: MPC(ocp=problem(), solver=ANY(10), **{"dt": "fast"})),
    ("derive: the problem is a int", lambda: derive(*[3])),
    ("hamiltonian: the problem is a Solution", lambda: hamiltonian(answer())),
    ("linear_quadratic: the problem is a int", lambda: linear_quadratic(*[3])),
    ("discretise: the problem is a int", lambda: discretise(*[3], 0.1)),
    ("the problem to transcribe is a NoneType", lambda: ANY().build(None)),
    ("the problem to transcribe is a int", lambda: Transcription(*[3], 4, ANY())),
    # Where a run starts, and its numbers.
    ("the guess is <class 'numpy.ndarray'>, a Guess",
     lambda: solve(problem(), ANY(10), guess=np.zeros((3, 2)))),  # type: ignore[arg-type]
    ("the guess is <class 'numpy.ndarray'>", lambda: run(guess=np.zeros(2))),
    ("the guess is <class 'dict'>", lambda: run(guess={"x": 1})),
    ("the guess is <class 'ocp.guess.Guess'>", lambda: run(guess=Guess)),
    ("the guess is <class 'ocp.problem.OCP'>", lambda: run(guess=problem())),
    ("the guess is <class 'ocp.guess.Guess'>", lambda: point(guess=Guess)),
    ("the guess is <class 'numpy.ndarray'>", lambda: point(guess=np.zeros(3))),
    ("t0 = 'now'", lambda: run(t0="now")),
    ("t0 = None", lambda: run(t0=None)),
    (r"t0 = \[0, 1\]", lambda: run(t0=[0, 1])),
    ("parameters .* is a list", lambda: run(parameters=[1])),
    ("parameters .* is a str", lambda: run(parameters="k")),
    # Descriptions.
    ("free final time: guess = 'a'", lambda: FreeTime(*["a"])),
    ("free final time: guess = None", lambda: FreeTime(*[None])),
    ("free final time: guess = inf", lambda: FreeTime(np.inf)),
    ("free final time: guess = array", lambda: FreeTime(*[np.array([1.0, 2.0])])),
    ("free final time: lower = 'a'", lambda: FreeTime(1.0, *["a"])),
    ("free final time: upper = nan", lambda: FreeTime(1.0, upper=np.nan)),
    ("guess: duration = 'a'", lambda: Guess(**{"duration": "a"})),
    ("the name of a model is a int", lambda: dynamics(name=3)),
    ("x_units is a int", lambda: dynamics(x_units=3)),
    ("x_units is a str", lambda: dynamics(x_units="ms")),
    ("dt = 'a'", lambda: dynamics(dt="a")),
    ("dt = -1", lambda: dynamics(dt=-1)),
    ("the name of a problem is a NoneType", lambda: point(name=None)),
    ("horizon = True", lambda: point(horizon=True)),
    ("smoothness = array", lambda: point(smoothness=np.array([1, 2]))),
    ("control_bounds is the class Box, Box is needed: write Box",
     lambda: point(control_bounds=Box)),
    ("the name of a constraint is a SX", lambda: Constraint(ca.SX.sym("x"), *["c"])),
    # Solvers' options.
    ("tolerance = 'a'", lambda: MultipleShooting(**{"tolerance": "a"})),
    ("tolerance = nan", lambda: MultipleShooting(tolerance=np.nan)),
    ("accuracy = None", lambda: MultipleShooting(**{"accuracy": None})),
    ("tolerance = 'a'", lambda: StagewiseNewton(**{"tolerance": "a"})),
    ("tolerance = 'a'", lambda: Collocation(**{"tolerance": "a"})),
    ("tolerance = 'a'", lambda: IndirectShooting(**{"tolerance": "a"})),
    ("delta = None", lambda: IndirectShooting(**{"delta": None})),
    ("max_steps must be a whole", lambda: IndirectShooting(**{"max_steps": 2.5})),
    ("continuation is a str", lambda: IndirectShooting(**{"continuation": "a"})),
    ("Greedy: intervals must be a whole", lambda: Greedy(**{"intervals": "a"})),
    ("GridDP: intervals must be a whole", lambda: GridDP(9, **{"intervals": 2.5})),
    ("Schuetz: decrease = 'a'", lambda: Schuetz(**{"decrease": "a"})),
    ("fixed step: alpha = None", lambda: FixedStep(*[None])),
    ("Armijo: decrease = 0.5, it must be positive, below 0.5", lambda: Armijo(0.5)),
    ("Armijo: most must be a whole", lambda: Armijo(most=0)),
    ("continuation: first = 'a', it must be positive, below 1",
     lambda: HorizonContinuation(*["a"])),
    ("continuation: first = 1.0, it must be 0 or more, below 1",
     lambda: ParameterContinuation("k", 0.0, 1.0)),
    ("continuation: name is a int", lambda: ParameterContinuation(*[3], 0.0)),
    ("reverse shooting: tolerance = 'a'", lambda: ReverseShooting(**{"tolerance": "a"})),
    ("between nodes: tolerance = 'a'", lambda: BetweenNodes(**{"tolerance": "a"})),
    ("augmented Lagrangian: complementarity = None",
     lambda: AugmentedLagrangian(ANY(), **{"complementarity": None})),
    ("augmented Lagrangian: penalty = 'a'",
     lambda: AugmentedLagrangian(ANY(), **{"penalty": "a"})),
    ("collocation: accuracy = 'a'", lambda: Collocation(**{"accuracy": "a"})),
    ("GridDP: terminal_slack = None", lambda: GridDP(**{"terminal_slack": None})),
    ("axis: points must be a whole number of at least 3, not 3.0", lambda: Axis(0, 1, *[3.0])),
    ("GPC: weight = 'a'", lambda: GPC(**{"weight": "a"})),
    ("GPC: tolerance = 1.0, it must be positive, below 1", lambda: GPC(tolerance=1.0)),
    ("certify: seconds = 'a'", lambda: Effort(**{"seconds": "a"})),
    # The loop.
    ("tolerance = 'a', it must be 0 or more",
     lambda: MPC(ocp=problem(), solver=ANY(10), dt=0.1, **{"tolerance": "a"})),
    (r"instantaneous control: reach \[s\] = 'far'",
     lambda: instantaneous(problem(), **{"reach": "far"})),
    (r"plant: lag \[s\] = 'a'", lambda: Plant(ocp=problem(), **{"lag": "a"})),
    ("plant: jitter = 1.0, it must be 0 or more, below 1",
     lambda: Plant(ocp=problem(), jitter=1.0)),
    # Models.
    ("cart-pole: pole = 'a'", lambda: CartPole(**{"pole": "a"})),
    ("cart-pole: force = 'a'", lambda: cart_pole_swing_up(**{"force": "a"})),
    ("Goddard: fastest = None", lambda: goddard(**{"fastest": None})),
    ("disc: radius = '0.1'", lambda: Disc([0.0, 0.0], *["0.1"])),
    ("discrete double integrator: steps must be a whole",
     lambda: discrete_double_integrator(*["a"], 0.1)),
    ("random scenarios: links must be a whole",
     lambda: random_scenarios(links="a", count=1, seed=0)),
    ("carima: delay must be a whole number of at least 0",
     lambda: Carima((1.0,), (1.0,), delay=-1)),
    # Solutions.
    ("solution: problem is a int", lambda: answer().with_(problem=3)),
    ("solution: status is a str", lambda: answer().with_(status="SOLVED")),
    ("solution: u is a list", lambda: answer().with_(u=[1, 2])),
    ("solution: t is a str", lambda: answer().with_(t="abc")),
    ("solution: x is a NoneType", lambda: answer().with_(x=None)),
    ("solution: control_kind = 'wavy' is none of held,",
     lambda: answer().with_(control_kind="wavy")),
    ("solution: cost is a str", lambda: answer().with_(cost="a")),
    ("the problem that here.npz is to be a solution of is a str",
     lambda: Solution.load("here.npz", *["Van der Pol"])),
    ("the path of a saved solution is a OCP", lambda: Solution.load(problem(), problem())),
]  # fmt: skip


@pytest.mark.parametrize(("said", "wrong"), CALLS, ids=[said[:50] for said, _ in CALLS])
def test_nonsense_is_refused_by_name(said: str, wrong: Wrong) -> None:
    with pytest.raises(ProblemError, match=said):
        wrong()


def test_what_looks_odd_but_is_right() -> None:
    assert MultipleShooting(10, accuracy=np.inf).build(problem()).run(t0=1).status is Status.SOLVED
    assert evaluate(answer(), tolerance=np.float32(1e-6)).violation == 0.0
    assert FreeTime(1, 1, 1).guess == 1
    assert dynamics(x_units=["m", "m/s"]).nx == 2
    assert run(parameters={}, guess=Guess(u=[0.1])).status is Status.SOLVED
    assert len(multistart(problem(), ANY(10), np.int64(1), 0)) == 1
