"""Prioritised inverse kinematics of an arm: it tracks, it avoids, it stays bounded."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from models import Disc, JointLimitCost, PlanarArm, link_distances, squared_manipulability
from ocp import ProblemError, SolverError, Status, evaluate
from solvers import (
    Damped,
    Exact,
    Filtered,
    PrioritisedKinematics,
    Repulsion,
    Task,
    descend,
    repel,
    track,
)
from tests.kinematic.problems import (
    ARM,
    Q3,
    REPULSION,
    SCENARIO,
    START,
    Q,
    T,
    avoid_scenario,
    away,
    follow_scenario,
    orientation,
    position,
)

PRIORITY = 1e-10
TRACKING = 1e-4  # [m], as the issue asks for


def clearance(q: np.ndarray, disc: Disc) -> float:
    theta = ca.SX.sym("theta", 4)
    d = ca.Function("d", [theta], [ca.mmin(link_distances(ARM, theta, disc))])
    return float(np.array(d.map(len(q))(q.T)).min())


# -- what the issue asks for ----------------------------------------------------------


def tracking_error(gain: float, *, avoiding: bool, decoupled: bool = True) -> float:
    """Over a line of 1.5 s, dt = 1 ms, lambda = 0.05."""
    tasks = (follow_scenario(gain), *([avoid_scenario()] if avoiding else []))
    controller = PrioritisedKinematics(tasks, Damped(0.05), decoupled=decoupled)
    run = controller.build().run(SCENARIO.theta0, duration=1.5)
    assert run.status is Status.MYOPIC
    return float(run.errors["end effector"].max())


@pytest.mark.slow
def test_tracking_error_with_feedback() -> None:
    alone, among = (tracking_error(100.0, avoiding=avoiding) for avoiding in (False, True))
    assert alone < TRACKING
    assert among < TRACKING
    # With the damped inverse in the null space the second task pushes the first off its path:
    # 1.5e-4 m here, and 0.1 m/s of repulsion less keep it below 1e-4.
    assert tracking_error(100.0, avoiding=True, decoupled=False) > 10 * among
    assert tracking_error(0.0, avoiding=False) > 50 * alone


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4), st.floats(0.0, 5.0))
@example(q=[0.0, 0.0, 0.0, 1e-8], speed=0.0)
def test_first_task_is_independent_of_the_second(q: list[float], speed: float) -> None:
    second = away(Disc([1.0, 0.5], 0.1), repulsion=Repulsion(0.1 + speed, 5.0, 6.0))
    alone = PrioritisedKinematics((position(),), Damped(0.05)).build()
    both = PrioritisedKinematics((position(), second), Damped(0.05)).build()
    j = np.array(ARM.jacobian(q))
    # J N is zero to rounding, times how fast the second task may be; but a direction in which J
    # moves by less than 1e-6 of its norm counts as singular, and is left to the second task.
    dq, s = both.velocity(q), np.linalg.svd(j, compute_uv=False)
    left = s[s <= 1e-6 * np.linalg.norm(j)].max(initial=0.0)
    slack = (PRIORITY + left) * max(1.0, float(np.linalg.norm(dq)))
    np.testing.assert_allclose(j @ dq, j @ alone.velocity(q), atol=slack)


@pytest.mark.many
@pytest.mark.parametrize("damping", [Damped(0.05), Filtered(0.05, 0.1)])
@pytest.mark.parametrize("decoupled", [True, False])
def test_velocities_stay_bounded_through_singular_configurations(
    damping: Any, decoupled: bool
) -> None:
    """Straight out until the arm is stretched, beyond its reach, and back."""
    start = np.array([0.5, -0.5, -0.3, 0.1])
    here = np.array(ARM.end_effector(start)).ravel()
    out = ca.DM(here) * (1.0 + 0.15 * ca.sin(np.pi / 2 * T) ** 2)
    assert np.linalg.norm(here) * 1.15 > sum(ARM.lengths) + 0.1
    task = track("reach", q=Q, t=T, value=ARM.end_effector(Q), desired=out, gain=10.0)
    others = (orientation(), away(Disc([1.5, 0.1], 0.1)))
    program = PrioritisedKinematics((task, *others), damping, decoupled=decoupled).build()
    run = program.run(start, duration=2.0)
    assert run.status is Status.INFEASIBLE
    assert "task 'reach' is missed" in run.message
    assert np.isfinite(run.q).all()
    largest = 1.0 / (2 * 0.05 * np.sqrt(0.75))  # of both inverses' gains
    for q, t, dq in zip(run.q[::20], run.t[::20], run.velocity[::20], strict=False):
        bound = 0.0
        for level in program.at(q, t):
            reach = np.linalg.norm(level.desired_velocity) + np.linalg.norm(level.jacobian) * bound
            bound += largest * level.activation * reach
        assert np.linalg.norm(dq) <= bound + 1e-9
    tasks = (task, *others)
    slow = PrioritisedKinematics(tasks, damping, decoupled=decoupled, speed_limit=5.0).build()
    assert np.abs(slow.run(start, duration=2.0, dt=5e-3).velocity).max() <= 5.0 + 1e-12


@pytest.mark.parametrize("q", [[0.3, 0, 0, 0], [0, np.pi, 0, 0], [0, np.pi, np.pi, np.pi]])
def test_at_a_singular_configuration(q: list[float]) -> None:
    tasks = (position(gain=0.0), orientation(), away(Disc([0.5, 0.1], 0.1)))
    for damping in (Exact(), Damped(), Filtered()):
        velocity = PrioritisedKinematics(tasks, damping).build().velocity(q)
        assert np.isfinite(velocity).all()
        if not isinstance(damping, Exact):
            assert np.abs(velocity).max() < 1e3


def test_speed_limit_slows_all_joints_alike() -> None:
    task = position(velocity=(3.0, 1.0), gain=0.0)
    free = PrioritisedKinematics((task,)).build().velocity(START)
    limited = PrioritisedKinematics((task,), speed_limit=0.5).build().velocity(START)
    assert np.abs(limited).max() == pytest.approx(0.5)
    np.testing.assert_allclose(np.cross([*limited[:2], 0], [*free[:2], 0]), 0.0, atol=1e-12)


# -- tasks ----------------------------------------------------------------------------


def test_orientation_goes_the_short_way_round() -> None:
    program = PrioritisedKinematics((orientation(desired=3.0),)).build()
    almost = np.array([-3.0, 0.0, 0.0, 0.0])  # 0.28 rad from 3.0 through pi
    assert program.velocity(almost).sum() == pytest.approx(5.0 * (6.0 - 2 * np.pi))
    run = program.run(almost, duration=3.0)
    assert run.status is Status.MYOPIC
    assert run.q[-1].sum() == pytest.approx(3.0 - 2 * np.pi, abs=1e-4)


def test_position_and_orientation_together() -> None:
    run = PrioritisedKinematics((position(), orientation(-0.2))).build().run(START, duration=1.5)
    assert run.errors["position"].max() < 1e-3
    assert run.errors["orientation"][-1] < 1e-2 < run.errors["orientation"][0]


@pytest.mark.slow
def test_obstacles_are_avoided_several_and_moving() -> None:
    still = Disc([1.75, 1.45], 0.15)
    moving = Disc([1.0, 0.25], 0.13).moving([0.0, 0.5], T)
    plain = PrioritisedKinematics((position((0, 0)),)).build().run(START, duration=1.5)
    tasks = (position((0, 0)), away(moving, "moving"), away(still, "still"))
    careful = PrioritisedKinematics(tasks).build().run(START, duration=1.5)

    def closest(run: Any) -> float:
        q, t = ca.SX.sym("q", 4), ca.SX.sym("time")
        d = ca.substitute(link_distances(ARM, Q, moving), ca.vertcat(Q, T), ca.vertcat(q, t))
        f = ca.Function("d", [q, t], [ca.mmin(d)]).map(len(run.t))
        return float(np.array(f(run.q.T, run.t[None, :])).min())

    assert closest(plain) < moving.radius < closest(careful)
    assert clearance(careful.q, still) > 0.15
    assert careful.errors["position"].max() < 1e-3


def test_a_moving_obstacle_is_met_with_its_own_speed() -> None:
    """Where the task is fully on, d grows at v0 alpha_v whatever the obstacle does."""
    disc = Disc([0.9, 0.7], 0.1)
    velocities = [
        PrioritisedKinematics((away(obstacle),), Exact()).build().velocity(START)
        for obstacle in (disc, disc.moving([0.3, 0.2], T))
    ]
    distance = ca.mmin(link_distances(ARM, Q, disc))
    slope = ca.Function("g", [Q], [ca.jacobian(distance, Q), distance])(START)
    j, d = np.array(slope[0]).ravel(), float(slope[1])
    assert d < REPULSION.d_m
    wanted = REPULSION.v0 * ((REPULSION.d_m / d) ** 2 - 1.0)
    assert j @ velocities[0] == pytest.approx(wanted)
    assert np.abs(velocities[1] - velocities[0]).max() > 0.01


@pytest.mark.slow
def test_joint_limit_as_an_obstacle() -> None:
    limit = START[1] - 0.05
    guard = repel("limit", q=Q, t=T, distance=Q[1] - limit, repulsion=Repulsion(0.5, 0.1, 0.2))
    free = PrioritisedKinematics((position((-0.4, -0.3)),)).build().run(START, duration=1.5)
    held = PrioritisedKinematics((position((-0.4, -0.3)), guard)).build().run(START, duration=1.5)
    assert free.q[:, 1].min() < limit
    assert held.q[:, 1].min() > limit
    assert held.errors["position"].max() < 1e-3


def test_a_run_is_judged_by_its_first_target() -> None:
    """With a joint limit as the first task it was MYOPIC wherever the hand went."""
    limit = START[1] - 0.05
    guard = repel("limit", q=Q, t=T, distance=Q[1] - limit, repulsion=Repulsion(0.5, 0.1, 0.2))
    beyond = PrioritisedKinematics((guard, position((-9.0, -9.0)))).build()
    run = beyond.run(START, duration=1.0)
    assert run.status is Status.INFEASIBLE
    assert "'position' is missed" in run.message
    near = PrioritisedKinematics((guard, position((-0.05, -0.05)))).build()
    assert near.run(START, duration=1.0).status is Status.MYOPIC


@pytest.mark.parametrize("kind", ["limits", "dexterity"])
def test_potentials_descend_in_the_null_space(kind: str) -> None:
    if kind == "limits":
        potential = JointLimitCost(100.0, -2.0, 2.0).of(ARM, Q)
    else:
        potential = -squared_manipulability(ARM, Q)
    still = position((0.0, 0.0))
    tasks = (still, descend(kind, q=Q, t=T, potential=potential, gain=0.2))
    run = PrioritisedKinematics(tasks).build().run(START, duration=2.0)
    value = ca.Function("H", [Q], [potential])
    along = np.array(value.map(len(run.q))(run.q.T)).ravel()
    assert along[-1] < along[0] - 0.01
    assert (np.diff(along) <= 1e-9).all()
    assert run.errors["position"].max() < 1e-5


def test_repulsion_functions() -> None:
    d = ca.DM([-1.0, 0.0, 0.25, 0.5, 0.65, 0.8, 2.0])
    velocity = np.array(ca.DM(REPULSION.velocity_gain(ca.SX(d)))).ravel()
    np.testing.assert_allclose(velocity, [100.0, 100.0, 3.0, 0.0, 0.0, 0.0, 0.0], atol=1e-9)
    homogeneous = np.array(ca.DM(REPULSION.homogeneous_gain(ca.SX(d)))).ravel()
    np.testing.assert_allclose(homogeneous, [1, 1, 1, 1, 0.5, 0, 0], atol=1e-12)


# -- the referee ----------------------------------------------------------------------


def test_the_referee_judges_a_run() -> None:
    run = PrioritisedKinematics((follow_scenario(), avoid_scenario())).build()
    solution = run.run(SCENARIO.theta0, duration=1.5, dt=5e-3).as_solution(
        SCENARIO.ocp("closest", form="velocity")
    )
    verdict = evaluate(solution)
    assert verdict.defect < 1e-9
    assert verdict.task_drift < 1e-3
    assert 3.805 < verdict.cost < 20.0, "more than the optimum"


def test_as_solution_needs_the_velocity_form() -> None:
    run = PrioritisedKinematics((position(),)).build().run(START, duration=0.1)
    with pytest.raises(ProblemError, match="3 states and 3 controls; a motion of 4 joints"):
        run.as_solution(SCENARIO.ocp(form="velocity"))
    short = PrioritisedKinematics((follow_scenario(),)).build().run(SCENARIO.theta0, duration=0.1)
    with pytest.raises(ProblemError, match=r"lasts 1\.5 s, the run 0\.1 s"):
        short.as_solution(SCENARIO.ocp(form="velocity"))


# -- bad input ------------------------------------------------------------------------


def test_a_target_outside_the_workspace() -> None:
    task = track("far", q=Q3, t=T, value=SCENARIO.arm.end_effector(Q3), desired=[4, 0], gain=5.0)
    run = PrioritisedKinematics((task,)).build().run(SCENARIO.theta0, duration=3.0, dt=0.01)
    assert run.status is Status.INFEASIBLE
    assert "'far' is missed" in run.message
    assert "out of reach" in run.message
    assert run.errors["far"][-1] == pytest.approx(1.0, abs=0.02), "it stretches as far as it can"


def test_a_task_that_stops_being_finite() -> None:
    task = Task(name="log", q=Q3, t=T, value=Q3[0], rate=ca.log(0.5 - T))
    program = PrioritisedKinematics((task,)).build()
    with pytest.raises(SolverError, match=r"task 'log' is not finite at t = 1 s"):
        program.velocity([0, 0, 0], 1.0)
    run = program.run([0, 0, 0], duration=1.0, dt=0.1)
    assert run.status is Status.DIVERGED
    assert "not finite at t = 0.5 s" in run.message
    assert np.isfinite(run.q).all()
    assert len(run.q) == len(run.t) == len(run.velocity) + 1 == 6


def task(name: str, value: Any, **changes: Any) -> Task:
    rate = np.zeros(ca.SX(value).numel())
    return Task(**{"name": name, "q": Q, "t": T, "value": value, "rate": rate, **changes})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: task("many", ca.vertcat(Q, Q[0] + Q[1])), "task 'many': 5 rows, more than none"),
        (lambda: task("none", ca.SX(0, 1)), "task 'none': 0 rows"),
        (lambda: task("a", Q, rate=[0.0]), "rate has 1 rows for 4 values"),
        (lambda: task("a", Q, activation=Q), "the activation 4, 1 is needed"),
        (lambda: task("a", Q3), "value contains q_0, q_1, q_2, neither q nor t"),
        (lambda: task("a", ca.mtimes(Q, Q.T)), r"value has shape \(4, 4\)"),
        (lambda: task("a", Q, rate="fast"), "rate is a str"),
        (lambda: task("a", Q, q=Q + 1), "q is no column of SX symbols"),
        (lambda: track("a", q=Q, t=T, value=Q, desired=[0.0]), "4 values, 1 desired"),
        (lambda: track("a", q=Q, t=T, value=Q, desired=Q, gain=-1), "gain = -1"),
        (lambda: track("a", q=Q, t=T, value=Q, desired=Q, gain=[1, 2]), r"gain has shape \(2,\)"),
        (lambda: track("a", q=Q, t=T, value=Q, desired=Q, gain="x"), "gain is not numeric"),
        (lambda: track("a", q=Q, t=T, value=Q, desired=Q, angular=[True] * 3), "angular has 3"),
        (lambda: descend("a", q=Q, t=T, potential=Q, gain=1.0), "potential has 4 entries"),
        (lambda: Repulsion(0.0, 0.5, 0.8), "v0 = 0.0"),
        (lambda: Repulsion(1.0, 0.8, 0.8), "d_i = 0.8 m must be larger than d_m = 0.8 m"),
        (lambda: Repulsion(1.0, -0.8, 0.8), "d_m = -0.8"),
    ],
)
def test_bad_tasks(make: Any, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        make()


OTHER_T = ca.SX.sym("t")


@pytest.mark.parametrize(
    ("tasks", "options", "message"),
    [
        ((), {}, "at least one Task"),
        (position(), {}, "must be a tuple"),
        ((position(), "avoid"), {}, r"tasks\[1\] is a str, Task is needed"),
        ((position(), position()), {}, "two tasks have the same name"),
        ((position(), follow_scenario()), {}, "has other symbols q or t than 'position'"),
        ((position(), task("late", Q[0], t=OTHER_T)), {}, "'late' has other symbols"),
        ((task("all", Q), orientation()), {}, "no redundancy is left for task 'orientation'"),
        (
            (position(),),
            {"damping": 0.05},
            "damping is a float, Inverse or tuple or list is needed",
        ),
        ((position(),), {"damping": (Exact(), Exact())}, "2 inverses for 1 tasks"),
        ((position(),), {"speed_limit": 0.0}, "speed_limit = 0.0"),
        ((position(),), {"tolerance": np.nan}, "tolerance = nan"),
    ],
)
def test_bad_controllers(tasks: Any, options: dict, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        PrioritisedKinematics(tasks, **options)


@pytest.mark.parametrize(
    "tasks",
    [
        (task("twice", ca.vertcat(Q[0] + Q[1], 2 * (Q[0] + Q[1]))),),
        (position(), task("again", ARM.end_effector(Q)[0])),
        (task("idle", ca.sin(T)),),
    ],
)
def test_linearly_dependent_tasks(tasks: Any) -> None:
    name = tasks[-1].name
    with pytest.raises(ProblemError, match=f"task '{name}' has rows that depend linearly"):
        PrioritisedKinematics(tasks).build()
    yielding = (*tasks[:-1], task(name, tasks[-1].value, may_conflict=True))
    assert np.isfinite(PrioritisedKinematics(yielding).build().velocity(START)).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"q0": START[:3], "duration": 1.0}, "4 finite numbers are needed"),
        ({"q0": [np.nan] * 4, "duration": 1.0}, "4 finite numbers"),
        ({"q0": "rest", "duration": 1.0}, "q is not numeric"),
        ({"q0": START, "duration": 0.0}, r"duration \[s\] = 0.0"),
        ({"q0": START, "duration": 1.0, "dt": -1.0}, r"dt \[s\] = -1.0"),
    ],
)
def test_bad_runs(arguments: dict, message: str) -> None:
    program = PrioritisedKinematics((position(),)).build()
    with pytest.raises(ProblemError, match=message):
        program.run(**arguments)


@pytest.mark.slow
def test_arms_of_3_to_12_links() -> None:
    for links in range(3, 13):
        arm, q = PlanarArm((3.0 / links,) * links), ca.SX.sym("q", links)
        start = np.append(1.5, np.full(links - 1, -2.0 / links))
        path = ca.DM(arm.end_effector(start)) + T * ca.DM([0.1, -0.2])
        obstacle = Disc(np.array(arm.joints(start))[:, links // 2] + [0.3, 0.0], 0.1)
        gentle = Repulsion(v0=0.2, d_m=0.25, d_i=0.4)
        tasks = (
            track("line", q=q, t=T, value=arm.end_effector(q), desired=path, gain=50.0),
            repel("disc", q=q, t=T, distance=link_distances(arm, q, obstacle), repulsion=gentle),
        )
        run = PrioritisedKinematics(tasks).build().run(start, duration=1.0, dt=2e-3)
        assert run.status is Status.MYOPIC
        # Euler's error, of order dt, while the disc pushes hardest; the feedback then removes it.
        assert run.errors["line"].max() < 2e-3
        assert run.errors["line"][-1] < 1e-5
