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
    CarimaPlant,
    CartPole,
    Disc,
    carima_ocp,
    cart_pole_swing_up,
    cart_pole_upright,
    clearance_constraint,
    line,
    link_distances,
    lq_regulator,
    mass_spring_damper,
    obstacles_from_data,
    path_position,
    random_scenarios,
    redundancy_ocp,
    sinusoid,
    squared_manipulability,
    stable_plant,
    state_space,
    step_reference,
    thesis_regulator,
    thesis_tracking,
    tracking_ocp,
)
from models.textbook import (
    bounded_ocp,
    discrete_double_integrator,
    goddard,
    unbounded_ocp,
    van_der_pol,
)
from ocp import (
    MPC,
    OCP,
    RK4,
    Box,
    Constraint,
    FeedbackLaw,
    FlightRecorder,
    FreeTime,
    Guess,
    Model,
    Plant,
    PlantInput,
    ProblemError,
    Rate,
    Rollout,
    Solution,
    Status,
    closed_loop,
    costates_along,
    discretise,
    evaluate,
    instantaneous,
    linear_quadratic,
    minimum_principle,
    records,
    replay,
    saturated_lqr,
    solve,
    with_stationary_end,
)
from ocp.codegen.compile import c_code, compiled
from ocp.integration.differentiable_step import differentiable_step
from ocp.integration.stage_hessian import stage_hessian
from ocp.linear.stationary import stationary
from ocp.minimum_principle.hamiltonian import hamiltonian
from ocp.minimum_principle.necessary_conditions import symbol_type
from ocp.nlp.transcription import Transcription
from ocp.problem.start_feasibility import start_violation
from solvers import (
    GPC,
    Armijo,
    AugmentedLagrangian,
    Axis,
    Batch,
    BetweenNodes,
    CertifyOptions,
    Collocation,
    FixedStep,
    Greedy,
    GridDP,
    HorizonContinuation,
    IndirectShooting,
    LinearMPC,
    Mesh,
    MultipleShooting,
    ParameterContinuation,
    PrioritisedKinematics,
    ReverseShooting,
    Riccati,
    Schuetz,
    StagewiseNewton,
    certify,
    descend,
    enumerate_extremals,
    gpc_loop,
    multistart,
    penalty_continuation,
    random_guesses,
    refine_mesh,
    repel,
    track,
)
from solvers.indirect.reverse.self_motion import seeds_around, self_motions


@cache
def problem() -> Any:
    return van_der_pol()


@cache
def answer() -> Any:
    return solve(problem(), MultipleShooting(10))


@cache
def mesh() -> Any:
    return refine_mesh(answer())


def run(**data: Any) -> Solution:
    return MultipleShooting(10).build(problem()).run(**data)


@cache
def driver() -> MPC:
    return MPC(ocp=problem(), solver=MultipleShooting(10), dt=0.1, compiled=False)


def plain_law() -> FeedbackLaw:
    return FeedbackLaw(law=lambda x, t: [0.0])


def loop(**changes: Any) -> Rollout:
    given: dict[str, Any] = {"controller": driver(), "plant": Plant(ocp=problem())}
    given |= {"x0": problem().start(), "duration": 0.1, "dt": 0.1}
    return closed_loop(**(given | changes))


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
NOWHERE = "no such folder/file"
T, PLANT = ca.SX.sym("t"), Carima((1.0, -0.5), (1.0,))


@pytest.mark.parametrize(
    "make",
    [
        StagewiseNewton,
        Collocation,
        Schuetz,
        IndirectShooting,
        ReverseShooting,
        GridDP,
        Greedy,
        Batch,
        LinearMPC,
        Riccati,
        BetweenNodes,
        lambda: AugmentedLagrangian(MultipleShooting()),
    ],
)
def test_no_solver_builds_what_is_no_problem(make: Callable[[], Any]) -> None:
    for wrong in (3, "a", None, OCP, answer()):
        with pytest.raises(ProblemError, match=r"the problem is (an?|the class) .*, OCP is needed"):
            make().build(wrong)


CALLS: list[tuple[str, Wrong]] = [
    # Functions of a solution.
    ("evaluate: solution is a MeshRefinement, Solution is needed: its .solution is one",
     lambda: evaluate(mesh())),
    ("evaluate: solution is an OCP, Solution is needed$", lambda: evaluate(problem())),
    ("evaluate: solution is a NoneType", lambda: evaluate(*[None])),
    ("evaluate: tolerance = 0.0, it must be positive", lambda: evaluate(answer(), tolerance=0.0)),
    ("evaluate: tolerance = nan", lambda: evaluate(answer(), tolerance=np.nan)),
    ("evaluate: tolerance = 'tight'", lambda: evaluate(answer(), **{"tolerance": "tight"})),
    ("costates_along: solution is an OCP", lambda: costates_along(problem())),
    ("certify: solution is an OCP", lambda: certify(problem())),
    ("certify: effort is an int", lambda: certify(answer(), *[3])),
    ("refine_mesh: start is an OCP", lambda: refine_mesh(problem())),
    ("refine_mesh: solver is a MultipleShooting", lambda: refine_mesh(answer(), solver=ANY())),
    ("refine_mesh: accuracy = 'x'", lambda: refine_mesh(answer(), **{"accuracy": "x"})),
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
    ("minimum_principle: the problem is an int", lambda: minimum_principle(*[3])),
    ("hamiltonian: the problem is a Solution", lambda: hamiltonian(answer())),
    ("linear_quadratic: the problem is an int", lambda: linear_quadratic(*[3])),
    ("discretise: the problem is an int", lambda: discretise(*[3], 0.1)),
    ("MultipleShooting: the problem is a NoneType", lambda: ANY().build(None)),
    ("the problem to transcribe is an int", lambda: Transcription(*[3], 4, ANY())),
    # Where a run starts, and its numbers.
    ("the guess is <class 'numpy.ndarray'>, a Guess",
     lambda: solve(problem(), ANY(10), guess=np.zeros((3, 2)))),  # type: ignore[arg-type]
    ("the guess is <class 'numpy.ndarray'>", lambda: run(guess=np.zeros(2))),
    ("the guess is <class 'dict'>", lambda: run(guess={"x": 1})),
    ("the guess is <class 'ocp.problem.guess.Guess'>", lambda: run(guess=Guess)),
    ("the guess is <class 'ocp.problem.ocp.OCP'>", lambda: run(guess=problem())),
    ("the guess is <class 'ocp.problem.guess.Guess'>", lambda: point(guess=Guess)),
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
    ("the name of a model is an int", lambda: dynamics(name=3)),
    ("x_units is an int", lambda: dynamics(x_units=3)),
    ("x_units is a str", lambda: dynamics(x_units="ms")),
    ("dt = 'a'", lambda: dynamics(dt="a")),
    ("dt = -1", lambda: dynamics(dt=-1)),
    ("the name of a problem is a NoneType", lambda: point(name=None)),
    ("horizon = True", lambda: point(horizon=True)),
    ("smoothness = array", lambda: point(smoothness=np.array([1, 2]))),
    ("control_bounds is the class Box, Box is needed: write Box",
     lambda: point(control_bounds=Box)),
    ("the name of a constraint is an SX", lambda: Constraint(ca.SX.sym("x"), *["c"])),
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
    ("continuation: name is an int", lambda: ParameterContinuation(*[3], 0.0)),
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
    ("certify: seconds = 'a'", lambda: CertifyOptions(**{"seconds": "a"})),
    ("the place of constraints = 'terminl' is no place; 'path',",
     lambda: problem().at(*["terminl"])),
    # The loop.
    ("tolerance = 'a', it must be 0 or more",
     lambda: MPC(ocp=problem(), solver=ANY(10), dt=0.1, **{"tolerance": "a"})),
    (r"instantaneous control: reach \[s\] = 'far'",
     lambda: instantaneous(problem(), **{"reach": "far"})),
    (r"plant: lag \[s\] = 'a'", lambda: Plant(ocp=problem(), **{"lag": "a"})),
    ("plant: jitter = 1.0, it must be 0 or more, below 1",
     lambda: Plant(ocp=problem(), jitter=1.0)),
    (r"MPC of Van der Pol: t \[s\] = 'now'", lambda: driver().step(problem().start(), *["now"])),
    ("MPC of Van der Pol: x is not numeric: 'a'", lambda: driver().step("a", 0.0)),
    (r"MPC of Van der Pol: x has shape \(3,\), \(2,\) is needed",
     lambda: driver().step(np.zeros(3), 0.0)),
    ("MPC of Van der Pol: plant is an OCP, Plant is needed",
     lambda: driver().run(*[problem()], problem().start(), 1.0)),
    (r"delay \[s\] = 'a'", lambda: MPC(ocp=problem(), solver=ANY(10), dt=0.1, **{"delay": "a"})),
    ("MPC: parameters is a dict, a function is needed",
     lambda: MPC(ocp=problem(), solver=ANY(10), dt=0.1, **{"parameters": {}})),
    ("the guess is <class 'str'>",
     lambda: MPC(ocp=problem(), solver=ANY(10), dt=0.1, **{"guess": "a"})),
    ("applied: bounds is a tuple", lambda: PlantInput("rate", *[(-1.0, 1.0)])),
    ("plant: saturation is a float", lambda: Plant(ocp=problem(), **{"saturation": 1.0})),
    ("plant: disturbance is a float", lambda: Plant(ocp=problem(), **{"disturbance": 1.0})),
    ("law: law is a float, a function is needed", lambda: FeedbackLaw(**{"law": 1.0})),
    (r"law: delay \[s\] = -1.0", lambda: FeedbackLaw(law=lambda x, t: [0.0], delay=-1.0)),
    ("law: the plan to follow is an OCP", lambda: FeedbackLaw.following(*[problem()])),
    ("closed loop: controller is a MultipleShooting", lambda: loop(controller=ANY())),
    ("closed loop: controller is the class MPC, Controller is needed$",
     lambda: loop(controller=MPC)),
    ("closed loop: plant is an OCP", lambda: loop(plant=problem())),
    (r"closed loop: duration \[s\] = 'a'", lambda: loop(duration="a")),
    ("closed loop: watch is an int, a function is needed", lambda: loop(watch=3)),
    ("flight recorder: mpc is a FeedbackLaw", lambda: FlightRecorder(*[plain_law()], "f")),
    ("the path of a flight record is an int", lambda: FlightRecorder(driver(), *[3])),
    ("the flight record .* cannot be written: No such", lambda: FlightRecorder(driver(), NOWHERE)),
    ("the flight record .* cannot be read: No such", lambda: next(records(NOWHERE))),
    ("the flight record .* cannot be read: No such", lambda: replay(driver(), NOWHERE, 0)),
    ("replay: mpc is an OCP", lambda: replay(*[problem()], NOWHERE, 0)),
    # Other functions of a problem.
    ("stationary: the matrices is an int", lambda: stationary(*[3])),
    ("with_stationary_end: the problem is an int", lambda: with_stationary_end(*[3])),
    ("Rate: control", lambda: Rate(*[3.0], lower=-1)),
    ("instantaneous: the problem is an int", lambda: instantaneous(*[3])),
    ("saturated_lqr: the problem is an int", lambda: saturated_lqr(*[3])),
    ("start_violation: the problem is an int", lambda: start_violation(*[3], answer().data)),
    ("stage_hessian: the problem is an int", lambda: stage_hessian(*[3], RK4())),
    ("differentiable_step: the problem is an int", lambda: differentiable_step(*[3], RK4())),
    ("hamiltonian: the problem is a ndarray", lambda: hamiltonian(*[np.zeros(2)])),
    ("symbol_kind: the function is an SX", lambda: symbol_type(*[ca.SX.sym("x")])),
    ("compiled: the function is an OCP", lambda: compiled(*[problem()])),
    ("c_code: the function is an int", lambda: c_code(*[3])),
    ("enumerate_extremals: the problem is an int", lambda: enumerate_extremals(*[3])),
    ("random_guesses: the problem is an int", lambda: random_guesses(*[3], 2, 0)),
    ("random_guesses: number must be", lambda: random_guesses(problem(), -1, 0)),
    ("multistart: violation = 'a'",
     lambda: multistart(problem(), ANY(10), 2, 0, **{"violation": "a"})),
    ("self_motions: manifold is an int", lambda: self_motions(*[3], [])),
    ("seeds_around: manifold is an int", lambda: seeds_around(*[3], np.zeros(2))),
    ("penalty continuation: soft is an int",
     lambda: penalty_continuation(*[3], problem(), ANY(), parameter="k")),
    ("mesh: edges is an int", lambda: Mesh(*[3], (3,))),
    ("mesh: edge = 'a'", lambda: Mesh(*[("a", 1.0)], (3,))),
    ("axis: lower = None", lambda: Axis(*[None], 1.0, 5)),
    ("kinematics: tasks must be a tuple", lambda: PrioritisedKinematics(*[3])),
    ("task 'hand': q is no column", lambda: track("hand", q=3, t=T, value=T, desired=T)),
    ("task 'rest': t is no column", lambda: descend("rest", q=T, t="t", potential=T, gain=1.0)),
    ("task 'wall': repulsion is an int", lambda: repel("wall", q=T, t=T, distance=T, repulsion=3)),
    ("GPC: input_bounds is a tuple", lambda: GPC(**{"input_bounds": (-1.0, 1.0)})),
    ("GPC: model is an int", lambda: GPC().build(*[3])),
    ("GPC loop: law is an int", lambda: gpc_loop(*[3], CarimaPlant(PLANT), 1.0, 5)),
    ("GPC loop: plant is a Carima", lambda: gpc_loop(GPC().build(PLANT), *[PLANT], 1.0, 5)),
    # Models.
    ("carima plant: model is an int", lambda: CarimaPlant(*[3])),
    ("carima: model is a CarimaPlant",
     lambda: carima_ocp(*[CarimaPlant(PLANT)], reference=np.ones(4), weight=1.0)),
    ("cart-pole: system is an int", lambda: cart_pole_swing_up(*[3])),
    ("cart-pole: distance = 'a'", lambda: cart_pole_upright(**{"distance": "a"})),
    ("bounded_ocp: scenario is an int", lambda: bounded_ocp(*[3])),
    ("unbounded_ocp: scenario is an int", lambda: unbounded_ocp(*[3])),
    ("link distances: arm is an int", lambda: link_distances(*[3], T, Disc([0.0, 0.0], 0.1))),
    ("squared manipulability: arm is an int", lambda: squared_manipulability(*[3], T)),
    ("clearance: arm is an int", lambda: clearance_constraint(*[3], T, (), 0.1)),
    ("redundant arm: arm is an int",
     lambda: redundancy_ocp(*[3], line([0, 1], [0, 1]), theta0=[0.0], horizon=1.0)),
    ("path is an int, a function is needed", lambda: path_position(*[3], T)),
    ("lq_regulator: plant is a Model",
     lambda: lq_regulator(*[stable_plant().model], Q=1.0, R=1.0, x0=np.ones(3), horizon=3)),
    ("lq_regulator: plant is an int", lambda: thesis_regulator(*[3], 5)),
    ("tracking_ocp: plant is an int",
     lambda: tracking_ocp(*[3], np.ones(3), Q=1.0, R=1.0, x0=[0.0], horizon=2)),
    ("thesis_tracking: steps must be", lambda: thesis_tracking(*["a"])),
    ("sinusoid: t is not numeric", lambda: sinusoid("a")),
    ("step: t is not numeric", lambda: step_reference("a", [1.0])),
    ("linear: A is no matrix", lambda: state_space(3, [[1.0]])),
    ("mass-spring-damper: stiffness = 'a'", lambda: mass_spring_damper(**{"stiffness": "a"})),
    ("obstacle data: rows is an int", lambda: obstacles_from_data(*[3])),
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
    ("solution: problem is an int", lambda: answer().with_(problem=3)),
    ("solution: status is a str", lambda: answer().with_(status="SOLVED")),
    ("solution: u is a list", lambda: answer().with_(u=[1, 2])),
    ("solution: t is a str", lambda: answer().with_(t="abc")),
    ("solution: x is a NoneType", lambda: answer().with_(x=None)),
    ("solution: control_kind = 'wavy' is none of held,",
     lambda: answer().with_(control_kind="wavy")),
    ("solution: cost is a str", lambda: answer().with_(cost="a")),
    ("the problem that here.npz is to be a solution of is a str",
     lambda: Solution.load("here.npz", *["Van der Pol"])),
    ("the path of a saved solution is an OCP", lambda: answer().save(*[problem()])),
    ("the saved solution .* cannot be written: No such file", lambda: answer().save(NOWHERE)),
    ("the path of a saved solution is an OCP", lambda: Solution.load(problem(), problem())),
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
