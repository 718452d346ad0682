"""Kinematic control as an OCP: its identities, its forms, its bad inputs."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models import (
    ArmScenario,
    Capsule,
    Disc,
    DistanceCost,
    JointLimitCost,
    ManipulabilityCost,
    PlanarArm,
    Polygon,
    PostureCost,
    line,
    redundancy_ocp,
    squared_manipulability,
)
from ocp import OCP, Box, Parameter, ProblemError

# Two of the scenarios that the solvers are compared on.
ARM_001 = ArmScenario(
    name="arm-001",
    theta0=(1.1, -1.5, -1.6),
    obstacle=(1.6, 0.7),
    radius=0.2,
    influence=0.8,
    gain=100.0,
    velocity=(0.4, 0.0),
)
ARM_034 = ArmScenario(
    name="arm-034",
    theta0=(2.4, -1.5, -1.5),
    obstacle=(1.0, 1.0),
    radius=0.2,
    influence=0.8,
    gain=500.0,
    velocity=(0.4, 0.0),
    label="infeasible",
)
THETA0 = np.array(ARM_001.theta0)
TRIANGLE = Polygon([[-0.2, -0.5], [0.2, -0.5], [0.0, 0.2]])


def problem(**changes: Any) -> OCP:
    """Arm-001 without its obstacle, changed."""
    arm = changes.pop("arm", ARM_001.arm)
    path = changes.pop("path", ARM_001.path)
    return redundancy_ocp(arm, path, **{"theta0": THETA0, "horizon": 1.5, **changes})


def rate(ocp: OCP, x: np.ndarray, u: np.ndarray, t: float = 0.0) -> np.ndarray:
    return np.array(ocp.functions.rate(x, u, t, [])).ravel()


def running_cost(ocp: OCP, x: np.ndarray, u: np.ndarray, t: float = 0.0) -> float:
    return float(ocp.functions.running_cost(x, u, t, []))


def jacobian(arm: PlanarArm, theta: np.ndarray) -> np.ndarray:
    return np.array(arm.jacobian(theta))


# -- what is true of it -------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(st.integers(2, 12), st.integers(0, 1000))
def test_end_effector_moves_as_told_whatever_the_control(links: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm = PlanarArm(tuple(rng.uniform(0.5, 1.0, links)), base=(0.2, -0.1))
    theta, y = np.append(1.0, rng.uniform(-1.2, -0.4, links - 1)), rng.normal(size=links)
    start = np.array(arm.end_effector(theta)).ravel()
    ocp = redundancy_ocp(arm, line(start, [0.01, -0.02]), theta0=theta, horizon=1.0)
    moved = jacobian(arm, theta) @ rate(ocp, theta, y)
    np.testing.assert_allclose(moved, [0.01, -0.02], atol=1e-9)
    j = jacobian(arm, theta)
    inverse = np.linalg.pinv(j)
    expected = inverse @ [0.01, -0.02] + y - inverse @ j @ y
    np.testing.assert_allclose(rate(ocp, theta, y), expected, atol=1e-8)


@pytest.mark.parametrize("correction", [0.0, 3.0])
@pytest.mark.parametrize("combine", ["sum", "closest"])
def test_regularised_cost_adds_the_part_of_y_without_effect(
    combine: Any, correction: float
) -> None:
    regularised = ARM_001.ocp(combine, correction=correction)
    raw = ARM_001.ocp(combine, correction=correction, cost="raw")
    rng = np.random.default_rng(0)
    for _ in range(20):
        theta, y, t = THETA0 + rng.normal(0.0, 0.2, 3), rng.normal(size=3), rng.uniform(0.0, 1.5)
        j = jacobian(ARM_001.arm, theta)
        idle = np.linalg.pinv(j) @ j @ y
        expected = running_cost(raw, theta, y, t) + idle @ idle
        assert running_cost(regularised, theta, y, t) == pytest.approx(expected, rel=1e-9)


def test_minimising_control_is_that_of_the_thesis() -> None:
    """Thesis (3.39) in our sign: y* = -N psi / 2; H_yy is the constant diagonal 2E."""
    ocp = ARM_001.ocp()
    m, costate = ocp.model, ca.SX.sym("costate", 3)
    hamiltonian = ocp.running_cost + ca.dot(costate, m.f)
    curvature, slope = ca.hessian(hamiltonian, m.u)
    assert curvature.is_constant()
    np.testing.assert_array_equal(np.array(ca.DM(curvature)), 2.0 * np.eye(3))
    j, psi = jacobian(ARM_001.arm, THETA0), np.array([1.0, -2.0, 0.5])
    expected = -0.5 * (psi - np.linalg.pinv(j) @ j @ psi)
    gradient = ca.Function("H_y", [m.x, m.u, costate, m.t], [slope])(THETA0, expected, psi, 0.0)
    np.testing.assert_allclose(np.array(gradient).ravel(), 0.0, atol=1e-12)


def test_correction_pulls_the_end_effector_back() -> None:
    ocp = problem(path=line([0.5, 0.5], [0.1, 0.0]), correction=2.0)
    r = np.array(ARM_001.arm.end_effector(THETA0)).ravel()
    moved = jacobian(ARM_001.arm, THETA0) @ rate(ocp, THETA0, np.ones(3))
    np.testing.assert_allclose(moved, [0.1, 0.0] + 2.0 * (np.array([0.5, 0.5]) - r), atol=1e-9)


def test_velocity_form_is_bound_by_the_task() -> None:
    null_space, velocity = ARM_001.ocp(cost="raw"), ARM_001.ocp(form="velocity")
    y, v = np.array([1.0, -0.5, 2.0]), np.array([0.3, 0.2, -0.4])
    np.testing.assert_array_equal(rate(velocity, THETA0, v), v)
    (task,) = velocity.at("path")
    assert (task.name, task.is_equation) == ("task", True)
    followed = rate(null_space, THETA0, y)
    np.testing.assert_allclose(
        np.array(velocity.functions.path(THETA0, followed, 0.0, [])), 0.0, atol=1e-9
    )
    assert running_cost(velocity, THETA0, followed) == pytest.approx(
        running_cost(null_space, THETA0, y)
    )


@pytest.mark.parametrize("form", ["null-space", "velocity"])
def test_task_error_is_an_invariant_and_vanishes_at_the_start(form: Any) -> None:
    ocp = ARM_001.ocp(form=form)
    assert [c.name for c in ocp.invariants] == ["task error"]
    np.testing.assert_allclose(np.array(ocp.functions.invariants(THETA0, 0.0, [])), 0.0, atol=1e-15)
    later = np.array(ocp.functions.invariants(THETA0, 1.0, [])).ravel()
    np.testing.assert_allclose(later, [-0.4, 0.0], atol=1e-15)


# -- its options --------------------------------------------------------------------


@pytest.mark.parametrize("scenario", [ARM_001, ARM_034])
@pytest.mark.parametrize(("combine", "smoothness"), [("sum", 1), ("closest", 0)])
def test_comparison_scenarios(scenario: ArmScenario, combine: Any, smoothness: int) -> None:
    ocp = scenario.ocp(combine)
    assert ocp.smoothness == smoothness
    assert ocp.model.x_names == ("theta_0", "theta_1", "theta_2")
    assert ocp.model.x_units == ("rad",) * 3
    assert ocp.model.u_units == ("rad/s",) * 3
    text = ocp.describe()
    assert f"{scenario.name} {combine}" in text
    assert "task error, kept by the dynamics" in text


def test_smoothness_without_obstacles_and_without_weight() -> None:
    cost, disc = DistanceCost(1.0, 0.8, "closest"), Disc([1.6, 0.7], 0.2)
    assert problem().smoothness == 2
    assert problem(distance_cost=cost).smoothness == 2
    assert problem(distance_cost=cost, obstacles=[disc], weight=0.0).smoothness == 2
    assert problem(distance_cost=cost, obstacles=[disc]).smoothness == 0


def test_weight_scales_the_distance_cost_only() -> None:
    none, one, ten = (running_cost(ARM_001.ocp(weight=k), THETA0, np.ones(3)) for k in (0, 1, 10))
    assert one > none
    assert ten - none == pytest.approx(10.0 * (one - none))


def test_clearance_is_kept_by_every_link_from_every_disc() -> None:
    discs = [Disc([1.6, 0.7], 0.2), Disc([3.0, 3.0], 0.1)]
    ocp = problem(obstacles=discs, clearance=0.25)
    (clearance,) = ocp.at("path")
    assert (clearance.name, clearance.size) == ("clearance", 6)
    np.testing.assert_array_equal(np.asarray(clearance.lower), np.full(6, 0.25))
    assert ocp.smoothness == 2


def test_limits() -> None:
    limits = {"joint_bounds": Box(-3.0, 3.0), "velocity_bounds": Box(-1.0, 2.0)}
    null_space, velocity = problem(**limits), problem(**limits, form="velocity")
    (bound,) = null_space.at("path")
    assert bound.name == "joint velocity"
    np.testing.assert_allclose(
        np.array(null_space.functions.path(THETA0, [1, 2, 3], 0.0, [])).ravel(),
        rate(null_space, THETA0, np.array([1, 2, 3])),
    )
    assert not null_space.control_bounds.is_active
    np.testing.assert_array_equal(np.asarray(velocity.control_bounds.upper), np.full(3, 2.0))
    np.testing.assert_array_equal(np.asarray(velocity.state_bounds.lower), np.full(3, -3.0))


def test_free_start_binds_the_end_effector_only() -> None:
    ocp = problem(theta0=THETA0 + 0.1, free_start=True)
    assert ocp.has_free_start
    assert [c.name for c in ocp.at("initial")] == ["start on path"]
    error = np.array(ocp.functions.initial(THETA0, 0.0, []))
    np.testing.assert_allclose(error, 0.0, atol=1e-15)
    assert ARM_001.ocp(free_start=True).has_free_start


def test_moving_obstacle_and_parametric_path() -> None:
    t, speed = ca.SX.sym("t"), ca.SX.sym("speed")
    start = np.array(ARM_001.arm.end_effector(THETA0)).ravel()
    ocp = problem(
        path=lambda time: ca.DM(start) + ca.vertcat(speed * time, 0.0),
        parameters=[Parameter("speed", speed, 0.4)],
        obstacles=[Disc(ca.vertcat(1.6 + t, 0.7), 0.2)],
        distance_cost=DistanceCost(100.0, 0.8),
        t=t,
    )
    still = ARM_001.ocp()
    y = np.array([0.1, 0.2, 0.3])
    now = float(ocp.functions.running_cost(THETA0, y, 0.0, 0.4))
    assert now == pytest.approx(running_cost(still, THETA0, y))
    later = float(ocp.functions.running_cost(THETA0, y, 1.0, 0.4))
    assert later < now


def test_each_obstacle_may_have_its_own_clearance() -> None:
    obstacles = [Disc([1.6, 0.7], 0.2), Capsule([2.0, 1.0], [2.5, 1.0], 0.1), TRIANGLE]
    obstacles[2] = TRIANGLE.moved([2.0, -1.5])
    ocp = problem(obstacles=obstacles, clearance=[o.radius for o in obstacles])
    (clearance,) = ocp.at("path")
    np.testing.assert_array_equal(np.asarray(clearance.lower), np.repeat([0.2, 0.1, 0.0], 3))


def test_kinks_of_a_shape_are_declared() -> None:
    cost, capsule = DistanceCost(1.0, 0.8), Capsule([2.0, 1.0], [2.5, 1.0], 0.1)
    assert problem(distance_cost=cost, obstacles=[capsule]).smoothness == 0
    assert problem(obstacles=[capsule], clearance=0.1).smoothness == 2


@pytest.mark.parametrize("links", [3, 7, 12])
def test_obstacles_of_every_shape_around_an_arm_of_many_links(links: int) -> None:
    t = ca.SX.sym("t")
    arm, theta = PlanarArm((3.0 / links,) * links), np.append(1.5, np.full(links - 1, -2 / links))
    ocp = redundancy_ocp(
        arm,
        line(np.array(arm.end_effector(theta)).ravel(), [0.1, 0.0]),
        theta0=theta,
        horizon=1.0,
        obstacles=[
            Disc([0.5, -1.0], 0.1).moving([0.1, 0.0], t),
            Capsule([-1.0, 1.0], [-1.0, 2.0], 0.1),
            Polygon([[2.5, 2.5], [3.0, 2.5], [3.0, 3.0]], 0.05),
        ],
        distance_cost=DistanceCost(10.0, 2.0),
        posture_costs=[JointLimitCost(1.0, -3.0, 3.0), ManipulabilityCost(1.0, 2.0)],
        joint_bounds=Box(-3.0, 3.0),
        velocity_bounds=Box(-2.0, 2.0),
        t=t,
    )
    f = ocp.functions
    cost = ca.Function(
        "c", [ocp.model.x], [ca.gradient(f.running_cost(ocp.model.x, 1.0, 0.3, []), ocp.model.x)]
    )
    h = 1e-6
    slopes = [
        (
            running_cost(ocp, theta + h * e, np.ones(links), 0.3)
            - running_cost(ocp, theta - h * e, np.ones(links), 0.3)
        )
        / (2 * h)
        for e in np.eye(links)
    ]
    np.testing.assert_allclose(np.array(cost(theta)).ravel(), slopes, rtol=1e-6, atol=1e-6)


# -- what a posture costs -----------------------------------------------------------


POSTURE = ca.SX.sym("theta", 3)


def posture(term: PostureCost, theta: Any) -> tuple[float, np.ndarray]:
    value = term.of(ARM_001.arm, POSTURE)
    out = ca.Function("p", [POSTURE], [value, ca.gradient(value, POSTURE)])(theta)
    return float(out[0]), np.array(out[1]).ravel()


def test_joint_limit_cost() -> None:
    term = JointLimitCost(2.0, [-1.0, -2.0, 0.0], [1.0, 2.0, 1.0])
    assert posture(term, [0.0, 0.0, 0.5])[0] == pytest.approx(0.0)
    assert posture(term, [1.0, -2.0, 1.0])[0] == pytest.approx(0.5)
    np.testing.assert_allclose(posture(term, [1.0, 0.0, 0.5])[1], [1.0 / 3.0, 0.0, 0.0], atol=1e-12)


def test_manipulability_cost() -> None:
    term = ManipulabilityCost(3.0, 0.5)
    singular, slope = posture(term, [0.3, 0.0, 0.0])
    assert singular == pytest.approx(1.0)
    np.testing.assert_allclose(slope, 0.0, atol=1e-12)
    assert posture(term, THETA0) == (0.0, pytest.approx(np.zeros(3)))
    j = jacobian(ARM_001.arm, np.array([0.3, 0.1, 0.1]))
    w2 = ca.Function("w", [POSTURE], [squared_manipulability(ARM_001.arm, POSTURE)])
    assert float(w2([0.3, 0.1, 0.1])) == pytest.approx(np.linalg.det(j @ j.T))
    near, slope = posture(term, [0.3, 0.1, 0.1])
    assert 0.0 < near < 1.0
    assert slope[1] < 0.0  # bending more costs less


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: JointLimitCost(-1.0, -1.0, 1.0), "gain = -1.0"),
        (lambda: JointLimitCost(1.0, [1.0, 2.0], [2.0, 2.0]), "above its lower one"),
        (lambda: JointLimitCost(1.0, [1.0, 2.0], [3.0]), "above its lower one"),
        (lambda: JointLimitCost(1.0, -np.inf, 1.0), "lower.0. is -inf"),
        (lambda: ManipulabilityCost(1.0, 0.0), "influence = 0.0"),
    ],
)
def test_bad_posture_costs(make: Any, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        make()


# -- bad input ----------------------------------------------------------------------


def far_path(t: ca.SX) -> ca.SX:
    start = np.array(ARM_001.arm.end_effector(THETA0)).ravel()
    return ca.DM(start) + ca.vertcat(3.0 * t, 0.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"theta0": [1.0, 2.0]}, "theta0 has 2 entries, 3 are needed"),
        ({"theta0": [1.0, np.nan, 0.0]}, r"theta0\[1\] is nan"),
        ({"horizon": 0.0}, "horizon = 0.0, it must be positive"),
        ({"horizon": np.nan}, "horizon = nan"),
        ({"weight": -1.0}, "weight = -1.0"),
        ({"correction": -1.0}, "correction = -1.0"),
        ({"cost": "cheap"}, "cost = 'cheap'"),
        ({"form": "polar"}, "form = 'polar'"),
        ({"clearance": 0.2}, "there are no obstacles"),
        ({"clearance": 0.0, "obstacles": [ARM_001.disc]}, "clearance = 0.0"),
        ({"obstacles": [ARM_001.disc]}, "need a distance_cost or a clearance"),
        ({"obstacles": ARM_001.disc, "clearance": 0.2}, r"put it into a tuple: \(Disc"),
        ({"obstacles": [(1.6, 0.7)], "clearance": 0.2}, r"obstacles\[0\] is a tuple, Obstacle"),
        ({"obstacles": [ARM_001.disc], "clearance": [0.2, 0.3]}, "clearance has 2 entries"),
        ({"obstacles": [TRIANGLE], "clearance": -0.1}, "clearance = -0.1, it must be 0 or more"),
        ({"obstacles": [Disc([0.1, 0.1], 0.2)], "clearance": 0.2}, "covers the base of the arm at"),
        (
            {"obstacles": [TRIANGLE.moved([0.0, 0.4])], "clearance": 0.0},
            r"Polygon\) covers the base",
        ),
        (
            {"obstacles": [TRIANGLE.moved([0.6, 1.0])], "clearance": 0.0},
            "start is inside it: link 1",
        ),
        ({"obstacles": [ARM_001.disc], "distance_cost": 100.0}, "distance_cost is a float"),
        ({"posture_costs": [1.0]}, r"posture_costs\[0\] is a float, PostureCost is needed"),
        ({"posture_costs": [JointLimitCost(1.0, [-1, -1], [1, 1])]}, "2 limits, the arm has 3"),
        ({"velocity_bounds": (-1.0, 1.0)}, "velocity_bounds is a tuple, Box is needed"),
        ({"joint_bounds": (-1.0, 1.0)}, "joint_bounds is a tuple, Box is needed"),
        ({"path": line([0.5, 0.5], [0.0, 0.0])}, "the path starts .* m away from the end effector"),
        ({"path": far_path}, r"leaves the workspace at t = 0\.\d+ s: 3\.\d+ m from the base"),
        ({"path": lambda t: ca.SX.sym("where", 2)}, "path contains where_0, where_1, neither t"),
        ({"path": lambda t: ca.vertcat(1.0 / t, 0.0)}, "path is not finite at t = 0 s"),
        ({"joint_bounds": Box(0.0, 1.0)}, r"x0\[0\] \(theta_0\) = 1.1 is outside"),
        ({"velocity_bounds": Box(1.0, -1.0)}, "no number lies between"),
    ],
)
def test_bad_input(changes: dict, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        problem(**changes)


@pytest.mark.parametrize("theta0", [(0.5, 0.0, 0.0), (0.5, np.pi, 0.0), (0.5, 1e-7, -1e-7)])
@pytest.mark.parametrize("form", ["null-space", "velocity"])
def test_singular_start(theta0: tuple[float, ...], form: Any) -> None:
    start = np.array(ARM_001.arm.end_effector(theta0)).ravel()
    with pytest.raises(ProblemError, match=r"singular start: J.* without full rank"):
        problem(path=line(start, -0.1 * start), theta0=theta0, form=form)


def test_one_link_is_always_singular() -> None:
    with pytest.raises(ProblemError, match="singular start"):
        problem(arm=PlanarArm((1.0,)), path=line([1.0, 0.0], [0.0, 0.1]), theta0=[0.0])


def test_path_into_the_inner_hole() -> None:
    arm, theta0 = PlanarArm((2.0, 0.5)), [0.0, 1.5]
    start = np.array(arm.end_effector(theta0)).ravel()
    with pytest.raises(ProblemError, match=r"leaves the workspace at t = .*reaches 1.5 to 2.5 m"):
        problem(arm=arm, path=line(start, -0.5 * start), theta0=theta0)
