"""Motions from rest to rest: closed forms, torques that hold, and the Panda."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from models.robot import Payload, Robot, panda, read_urdf, torque_ocp
from ocp import OCP, Guess, Parameter, ProblemError, Signal, Solution, Solver, evaluate, solve
from solvers import Collocation, MultipleShooting
from tests.tolerances import ORDER, SAME_PROGRAM

LINK = """<link name="{name}"><inertial><origin xyz="0.25 0 0"/><mass value="2"/>
    <inertia ixx="0" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.04"/></inertial></link>"""
JOINT = """<joint name="{name}" type="revolute"><origin xyz="{x} 0 0"/><parent link="{parent}"/>
    <child link="{child}"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="{velocity}" effort="{effort}"/></joint>"""

# What binds in the motion below; STRONG binds nowhere.
EFFORT, STRONG = 7.0, 1e3
TIME, STEPS = 0.8, 20


def arm(*, velocity: float = 20.0, effort: float = EFFORT) -> Robot:
    """Return two links of 0.5 m that swing in a vertical plane, on a planet with little gravity.

    With that of the earth there are many local optima, and which one is found is not the point.
    """
    limits: dict[str, float] = {"velocity": velocity, "effort": effort}
    parts = [
        '<robot name="arm"><link name="base"/>',
        *(LINK.format(name=name) for name in ("upper", "lower")),
        JOINT.format(name="shoulder", x=0.0, parent="base", child="upper", **limits),
        JOINT.format(name="elbow", x=0.5, parent="upper", child="lower", **limits),
        "</robot>",
    ]
    return Robot(read_urdf("".join(parts)), gravity=(0.0, 0.0, -1.0))


START, GOAL = np.array([1.2, 0.3]), np.array([-0.3, 0.9])
SOLVER = MultipleShooting()


def motion(robot: Robot | None = None, **options: Any) -> OCP:
    given: dict[str, Any] = {"horizon": TIME, "steps": STEPS, "acceleration_weight": 0.0}
    return torque_ocp(robot or arm(), START, GOAL, **(given | options))


def solved(problem: OCP, solver: Solver = SOLVER, **run: Any) -> Solution:
    return solver.build(problem).run(**run).or_raise()


def torques(robot: Robot, x: np.ndarray, a: np.ndarray, time: float) -> np.ndarray:
    """Return what each step takes a time after its start, (N, n)."""
    q, v = np.split(x[:-1], 2, axis=1)
    q, v = q + time * v + time**2 / 2 * a, v + time * a
    found = [robot.inverse_dynamics(*row) for row in zip(q, v, a, strict=True)]
    return np.array([np.array(each).ravel() for each in found])


@pytest.fixture(scope="module")
def in_the_middle() -> Solution:
    return solved(motion())


@pytest.fixture(scope="module")
def at_both_ends() -> Solution:
    return solved(motion(torque_at="ends"))


def test_one_joint_without_gravity_has_a_closed_form() -> None:
    """Least integral of (I q'')^2 from rest to rest: 12 I^2 d^2 / T^3, and held 1 / (1 - N^-2)."""
    text = f'<robot name="one"><link name="base"/>{LINK.format(name="upper")}'
    text += JOINT.format(name="j", x=0, parent="base", child="upper", velocity=9, effort=1)
    free = text.replace('effort="1"', "") + "</robot>"
    robot = Robot.from_urdf(free)
    robot = Robot(robot.description, gravity=(0.0, 0.0, 0.0))
    inertia = 0.04 + 2 * 0.25**2
    options: Any = {"horizon": 0.7, "acceleration_weight": 0.0}
    least = 12 * inertia**2 * 1.1**2 / 0.7**3
    held = solved(torque_ocp(robot, [0.2], [1.3], steps=10, **options))
    assert held.cost == pytest.approx(least / (1 - 10**-2), rel=1e-9)
    smooth = solved(torque_ocp(robot, [0.2], [1.3], **options), Collocation(4))
    assert smooth.cost == pytest.approx(least, rel=1e-8)
    forward = solved(
        torque_ocp(robot, [0.2], [1.3], form="torque", **options), MultipleShooting(10)
    )
    assert forward.cost == pytest.approx(least / (1 - 10**-2), rel=1e-8)


def test_the_torque_is_that_in_the_middle_of_each_step(in_the_middle: Solution) -> None:
    a, effort = np.split(in_the_middle.u, 2, axis=1)
    needed = torques(arm(), in_the_middle.x, a, TIME / STEPS / 2)
    np.testing.assert_allclose(effort, needed, atol=1e-7)  # the solver's tolerance is 1e-9
    assert np.abs(effort).max() <= EFFORT + 1e-6
    assert evaluate(in_the_middle).violation < 1e-6


def test_at_both_ends_no_step_exceeds_the_limits(
    in_the_middle: Solution, at_both_ends: Solution
) -> None:
    """The last step too; with the middle alone the ends exceed them a little."""
    a, *efforts = np.split(at_both_ends.u, 3, axis=1)
    for time, effort in zip((0.0, TIME / STEPS), efforts, strict=True):
        needed = torques(arm(), at_both_ends.x, a, time)
        np.testing.assert_allclose(effort, needed, atol=1e-7)
        assert np.abs(needed).max() <= EFFORT + 1e-6
    other = np.split(in_the_middle.u, 2, axis=1)[0]
    assert np.abs(torques(arm(), in_the_middle.x, other, 0.0)).max() > EFFORT


def test_both_forms_have_one_optimum() -> None:
    """Another description of the dynamics and another method; held controls cost a little more."""
    strong = arm(effort=STRONG)
    options: Any = {"horizon": 0.6, "steps": None}
    exact = solved(motion(strong, **options), Collocation(20))
    forward = solved(motion(strong, form="torque", **options), MultipleShooting(40))
    assert forward.cost == pytest.approx(exact.cost, rel=2e-3)  # of second order in the step
    assert forward.cost > exact.cost
    assert evaluate(exact).violation < 0.05  # between the nodes [N m], of some 15


@pytest.mark.slow
def test_the_middle_is_of_second_order() -> None:
    """Where no limit binds; each halving of the step leaves a quarter of the error."""
    strong = arm(effort=STRONG)
    costs = [solved(motion(strong, horizon=1.0, steps=n)).cost for n in (20, 40, 80)]
    coarse, fine = np.diff(costs)
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=ORDER)


def test_limits_hold() -> None:
    free = solved(motion())
    velocity = np.abs(free.x[:, 2:]).max()
    share = 0.9 * velocity / 20.0
    slower = solved(motion(velocity_share=share))
    assert np.abs(slower.x[:, 2:]).max() <= 0.9 * velocity + 1e-6
    a = np.vstack([np.zeros(2), free.u[:, :2]])
    most = np.abs(np.diff(a, axis=0)).max() / (TIME / STEPS)
    limited = solved(motion(jerk=0.7 * most))
    a = np.vstack([np.zeros(2), limited.u[:, :2]])
    assert np.abs(np.diff(a, axis=0)).max() <= 0.7 * most * TIME / STEPS + 1e-6
    assert min(slower.cost, limited.cost) > free.cost


def test_a_payload_is_a_run_argument() -> None:
    mass = ca.SX.sym("mass")
    options: Any = {"horizon": 1.2, "steps": 12}

    def problem(payload: Payload, *parameters: Parameter) -> OCP:
        robot = arm().carrying(payload)
        return torque_ocp(robot, START, GOAL, parameters=parameters, **options)

    program = SOLVER.build(
        problem(Payload("lower", mass, (0.5, 0.0, 0.0)), Parameter("mass", mass, 0.2))
    )
    costs = {m: program.run(parameters={"mass": m}).or_raise().cost for m in (0.2, 0.6)}
    for m, cost in costs.items():
        fixed = solved(problem(Payload("lower", m, (0.5, 0.0, 0.0))))
        assert cost == pytest.approx(fixed.cost, rel=SAME_PROGRAM)
    assert costs[0.6] > costs[0.2]


def test_start_and_goal_are_run_arguments(in_the_middle: Solution) -> None:
    program = SOLVER.build(
        torque_ocp(arm(), GOAL, START, horizon=TIME, steps=STEPS, acceleration_weight=0.0)
    )
    again = program.run(
        x0=[*START, 0.0, 0.0], parameters={"goal": GOAL}, guess=motion().guess
    ).or_raise()
    assert again.cost == pytest.approx(in_the_middle.cost, rel=SAME_PROGRAM)


def test_too_little_time_is_infeasible() -> None:
    found = solve(motion(horizon=0.2), SOLVER)
    assert not found.status.is_success


# -- the Panda ----------------------------------------------------------------------

REST = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
AWAY = np.array([1.2, 0.3, -0.4, -1.6, 0.5, 2.2, -0.3])


@pytest.mark.slow
def test_the_panda_moves_from_the_default_guess_by_every_backend() -> None:
    """Half of the torque, N = 40; two interior points and one of our own."""
    problem = torque_ocp(panda(), REST, AWAY, horizon=1.2, effort_share=0.5, steps=40)
    found = [solved(problem, MultipleShooting(backend=backend)) for backend in ("fatrop", "native")]
    assert found[0].cost == pytest.approx(found[1].cost, rel=SAME_PROGRAM)
    assert evaluate(found[1]).violation < 1e-6
    effort = np.abs(found[1].u[:, 7:])
    assert (effort <= 0.5 * panda().limits.effort + 1e-6).all()
    np.testing.assert_allclose(found[1].x[-1], [*AWAY, *np.zeros(7)], atol=1e-7)


# -- what is refused ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": [3.5, 0.0]}, "start: joint 'shoulder' is at 3.5, outside its limits -3 to 3"),
        ({"goal": [0.0, -3.1]}, "goal: joint 'elbow' is at -3.1, outside its limits"),
        ({"goal": [0.0]}, "goal has 1 entries, 2"),
        ({"horizon": 0.0}, "horizon = 0.0, it must be positive"),
        (
            {"horizon": 0.05},
            "horizon = 0.05 s is too short: joint 'shoulder' has 1.5 rad to go, which takes 0.075",
        ),
        ({"form": "force"}, "form = 'force' is neither acceleration nor torque"),
        ({"torque_at": "start"}, "torque_at = 'start' is neither middle nor ends"),
        ({"steps": 1}, "steps must be a whole number of at least 2"),
        ({"effort_share": 1.5}, "effort_share = 1.5, it must be at most 1"),
        ({"acceleration_weight": -1.0}, "acceleration_weight = -1.0"),
        ({"jerk": [1.0, 2.0, 3.0]}, "jerk has 3 entries, 2"),
        ({"jerk": -1.0}, "no number lies between"),
        ({"form": "torque"}, "is in continuous time and knows no acceleration"),
        ({"robot": "panda"}, "robot is a str, Robot is needed"),
        ({"robot": arm(effort=0.0)}, "effort: the limit of joint 'shoulder' is 0: some"),
        ({"robot": arm(velocity=0.0)}, "velocity: the limit of joint 'shoulder' is 0"),
        (
            {"robot": arm().carrying(Payload("lower", ca.SX.sym("load")))},
            "parameters: in the robot, 'load' is a symbol without a value",
        ),
        (
            {"parameters": Parameter("load", ca.SX.sym("load"), 1.0)},
            "parameters is a Parameter, tuple or list",
        ),
        (
            {"robot": arm().locked({"shoulder": 0.0, "elbow": 0.0}), "start": [], "goal": []},
            "arm has no joint that moves",
        ),
        (
            {"form": "torque", "steps": None, "acceleration_weight": 1e-3},
            "knows no acceleration",
        ),
    ],
)
def test_wrong_input_is_named(options: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {
        "robot": arm(),
        "start": START,
        "goal": GOAL,
        "horizon": 1.0,
        "steps": 10,
    }
    with pytest.raises(ProblemError, match=message):
        torque_ocp(**(given | options))


def test_both_ends_of_a_step_are_paid_for_alike() -> None:
    """Half a step each; accelerations, the same at both, in full."""
    problem = motion(torque_at="ends", acceleration_weight=0.5)
    model = problem.model
    cost = ca.Function("cost", [model.x, model.u], [problem.running_cost])
    a, first, last = np.array([1.0, 2.0]), np.array([3.0, -1.0]), np.array([0.5, 4.0])
    paid = (first @ first + last @ last) / (2.0 * EFFORT**2) + 0.5 * a @ a
    found = float(cost(np.zeros(4), [*a, *first, *last]))
    assert found == pytest.approx(TIME / STEPS * paid)


def test_controls_have_the_units_of_their_joints() -> None:
    accelerations, torques = ["rad/s^2"] * 2, ["N m"] * 2
    assert list(motion().model.u_units) == [*accelerations, *torques]
    assert list(motion(torque_at="ends").model.u_units) == [*accelerations, *torques * 2]


def test_a_payload_that_is_a_signal_has_its_first_value_in_the_guess() -> None:
    mass, samples = ca.SX.sym("mass"), np.linspace(0.5, 3.0, STEPS + 1)[:, None]
    loaded = arm(effort=STRONG).carrying(Payload("lower", mass))
    known = arm(effort=STRONG).carrying(Payload("lower", 0.5))
    signal = motion(loaded, parameters=[Signal("mass", mass, samples)])
    guess, expected = signal.guess, motion(known).guess
    assert isinstance(guess, Guess)
    assert isinstance(expected, Guess)
    np.testing.assert_allclose(np.asarray(guess.u), np.asarray(expected.u))


def test_the_form_in_torques_has_usable_defaults() -> None:
    problem = torque_ocp(arm(), START, GOAL, horizon=1.0, form="torque")
    assert problem.model.nu == 2
