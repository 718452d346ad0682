"""Kinematic control of a redundant arm as an optimal control problem."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import casadi as ca
from numpy.typing import ArrayLike

from models._ldl import ldl_solve
from models._numbers import vector
from models.arm import PlanarArm
from models.arm_path import ArmPath
from models.avoidance import Surroundings, check_avoidance, clearance_constraint
from models.distance_cost import DistanceCost
from models.obstacles import Obstacle
from models.paths import Path, path_position
from models.posture_cost import PostureCost
from models.robot.robot import Robot
from models.robot.tasks import SpaceTask
from models.robot_path import RobotPath
from ocp import OCP, Box, Constraint, Model, Parameter, ProblemError, Signal
from ocp.internal import check_instance, check_not_negative, check_positive

Cost = Literal["regularised", "raw"]
Form = Literal["null-space", "velocity"]


def redundancy_ocp(
    arm: PlanarArm | Robot,
    path: Path | SpaceTask,
    *,
    theta0: ArrayLike,
    horizon: float,
    obstacles: Sequence[Obstacle] = (),
    distance_cost: DistanceCost | None = None,
    posture_costs: Sequence[PostureCost] = (),
    weight: float = 1.0,
    cost: Cost = "regularised",
    form: Form = "null-space",
    correction: float = 0.0,
    clearance: ArrayLike | None = None,
    joint_bounds: Box | None = None,
    velocity_bounds: Box | None = None,
    free_start: bool = False,
    parameters: Sequence[Parameter | Signal] = (),
    t: ca.SX | None = None,
    name: str = "redundant arm",
) -> OCP:
    r"""Return the problem of following a path while staying away from obstacles.

    Null-space form, control y (n,):

    .. math::

        \min \int k\,p_0(\theta) + \dot\theta'\dot\theta \, dt, \quad
        \dot\theta = J^\# \dot r + N y, \quad
        \dot r = \dot r_d + K (r_d - r(\theta)), \quad
        J^\# = J'(JJ')^{-1}, \; N = E - J^\# J

    This raw cost says nothing about the part of y in the row space of J, which moves
    nothing: H_yy is singular. The regularised cost adds its square, ‖J#J y‖². Neither the
    optimum nor its value changes, and because J#ṙ, N y and J#J y are orthogonal,

    .. math:: k\,p_0 + \lVert J^\# \dot r \rVert^2 + y'y, \qquad H_{yy} = 2E,

    which is how it is written here.

    Velocity form, control v = dθ/dt (n,): cost k p0 + v'v, path constraint ``"task"``
    J v = ṙ. It is the plant for controllers whose dθ/dt is not of the form J#ṙ + N y.

    The invariant ``"task error"`` is r(θ) - r_d(t) [m]; it is kept where the arm starts on
    the path, and decays with the rate K where it does not.

    Source: thesis (3.17) without damping, (3.18), (3.32), (3.37); [Nakamura 1991].

    Args:
        arm: a planar arm, n >= 2 links, or a robot in space with more joints than its task has
            rows, without obstacles.
        path: r_d(t), any callable from the time symbol to (2,) [m]; of a robot its task:
            ``PositionTask``, ``OrientationTask``, ``PoseTask``. Its error then stands for
            r - r_d.
        theta0: start configuration (n,) [rad].
        horizon: duration [s].
        obstacles: any number, of any shape, at rest or moving; with none there is no
            distance cost.
        distance_cost: p0; ``None``: no such cost.
        posture_costs: what else is charged, such as ``JointLimitCost``; each has its own
            gain and is added to the running cost.
        weight: k of (3.37), not negative.
        cost: ``"regularised"`` or ``"raw"``; the velocity form has only one cost.
        form: ``"null-space"`` or ``"velocity"``.
        correction: K of (3.18) [1/s], not negative; 0: a path error stays for ever.
        clearance: every link keeps at least this distance [m] from the core of every
            obstacle (a disc's centre), as path constraint ``"clearance"``; one number, or
            one for each obstacle, such as its radius; ``None``: no such constraint.
        joint_bounds: limits of θ [rad]; None: those of a robot, of a planar arm none. ``Box()``:
            none in any case.
        velocity_bounds: limits of dθ/dt [rad/s], None as above: control bounds of the velocity
            form, path constraint ``"joint velocity"`` of the null-space form.
        free_start: require only that the end effector starts on the path (initial
            constraint ``"start on path"``, thesis 3.46); ``theta0`` is then a guess.
        parameters: parameters and signals in the path or in the obstacles.
        t: the symbol of time [s] where an obstacle's position depends on it.
        name: what people call the problem.

    Returns:
        the problem, with states ``theta_i`` [rad], of a robot named as its joints, and controls
        [rad/s].

    Raises:
        ProblemError: for numbers out of range, a path that starts elsewhere than the arm
            (unless corrected or free) or leaves the workspace, a singular start, an
            obstacle on the base, a start inside an obstacle.
    """
    t = ca.SX.sym("t") if t is None else t
    check_instance(arm, (PlanarArm, Robot), f"{name}: arm")
    start = vector(theta0, arm.n, f"{name}: theta0")
    duration = check_positive(horizon, f"{name}: horizon")
    k = check_not_negative(weight, f"{name}: weight")
    gain = check_not_negative(correction, f"{name}: correction")
    _check_choices(name, cost, form)
    check_avoidance(name, obstacles, distance_cost, clearance)
    _check_kinds(name, posture_costs, joint_bounds, velocity_bounds)
    task = _task(arm, path, t, duration, parameters, name)
    task.check(start, must_start_on_path=gain == 0.0 and not free_start)
    if isinstance(arm, PlanarArm):
        around = Surroundings(
            arm=arm, obstacles=obstacles, t=t, horizon=duration, parameters=parameters, name=name
        )
        around.check(None if free_start else start)
    elif obstacles:
        raise ProblemError(f"{name}: obstacles of the plane are none of a Robot: leave them out")

    theta = _angles(arm)
    error = task.error(theta)
    rate = task.desired_rate - gain * error
    positions, velocities = _limits(arm)
    motion = _motion(task.jacobian(theta), rate, cost, form, velocity_bounds or velocities)
    avoided = obstacles if distance_cost and k > 0.0 else ()
    avoidance = ca.SX(0)
    if distance_cost and isinstance(arm, PlanarArm):
        avoidance = k * distance_cost.of(arm, theta, avoided)
    posture = sum((term.of(arm, theta) for term in posture_costs), ca.SX(0))
    constraints = [*motion.constraints]
    if clearance is not None and isinstance(arm, PlanarArm):
        constraints += [clearance_constraint(arm, theta, obstacles, clearance)]
    if free_start:
        constraints += [Constraint("start on path", error, 0.0, 0.0, at="initial")]
    return OCP(
        name=name,
        model=_model(arm, theta, motion, t),
        x0=start,
        horizon=duration,
        running_cost=avoidance + posture + motion.effort,
        control_bounds=motion.control_bounds,
        state_bounds=joint_bounds or positions,
        constraints=tuple(constraints),
        invariants=(Constraint("task error", error, 0.0, 0.0),),
        parameters=tuple(parameters),
        smoothness=_smoothness(distance_cost, avoided, posture_costs),
    )


def _angles(arm: PlanarArm | Robot) -> ca.SX:
    """Return the symbols of the joints (n,)."""
    if isinstance(arm, Robot):
        return ca.vertcat(*[ca.SX.sym(joint) for joint in arm.joints])
    return ca.SX.sym("theta", arm.n)


def _limits(arm: PlanarArm | Robot) -> tuple[Box, Box]:
    """Return where the joints may be, and how fast they may move."""
    if not isinstance(arm, Robot):
        return Box(), Box()
    known = arm.limits
    return Box(known.lower, known.upper), Box(-known.velocity, known.velocity)


@dataclass(frozen=True, eq=False)
class _Motion:
    """A form of the plant: what is controlled, what it does, what it costs, what binds it."""

    control: ca.SX
    velocity: ca.SX
    effort: ca.SX
    control_bounds: Box = field(default_factory=Box)
    constraints: tuple[Constraint, ...] = ()


def _motion(jacobian: ca.SX, rate: ca.SX, cost: Cost, form: Form, limits: Box) -> _Motion:
    """Return the plant that gives the end effector the velocity ``rate``, within ``limits``."""
    if form == "velocity":
        return _velocity_form(jacobian, rate, limits)
    y = ca.SX.sym("y", jacobian.shape[1])
    # J# r' + N y = y + J'(JJ')^-1 (r' - J y): no n x n matrix is formed.
    missing = rate - ca.mtimes(jacobian, y)
    velocity = y + ca.mtimes(jacobian.T, _gram_solve(jacobian, missing))
    if cost == "raw":
        effort = ca.sumsqr(velocity)
    else:  # |J# rate|^2 = rate' (JJ')^-1 rate, free of y; the rest is y'y exactly.
        effort = ca.dot(rate, _gram_solve(jacobian, rate)) + ca.sumsqr(y)
    bound = Constraint("joint velocity", velocity, limits.lower, limits.upper)
    return _Motion(y, velocity, effort, constraints=(bound,) if limits.is_active else ())


def _velocity_form(jacobian: ca.SX, rate: ca.SX, limits: Box) -> _Motion:
    v = ca.SX.sym("v", jacobian.shape[1])
    task = Constraint("task", ca.mtimes(jacobian, v) - rate, 0.0, 0.0)
    return _Motion(v, v, ca.sumsqr(v), control_bounds=limits, constraints=(task,))


def _gram_solve(jacobian: ca.SX, vector: ca.SX) -> ca.SX:
    """Return (JJ')^-1 vector (m,), two rows in closed form."""
    if jacobian.shape[0] != 2:
        return ldl_solve(ca.mtimes(jacobian, jacobian.T), vector)
    first, second = jacobian[0, :], jacobian[1, :]
    a, b, c = ca.sumsqr(first), ca.dot(first, second), ca.sumsqr(second)
    adjugate = ca.vertcat(c * vector[0] - b * vector[1], a * vector[1] - b * vector[0])
    return adjugate / (a * c - b**2)


def _task(
    arm: PlanarArm | Robot,
    path: Path | SpaceTask,
    t: ca.SX,
    horizon: float,
    parameters: Sequence[Parameter | Signal],
    name: str,
) -> ArmPath | RobotPath:
    """Return what the arm follows, with its error, its Jacobian and its checks."""
    if isinstance(arm, Robot):
        if not isinstance(path, SpaceTask):
            raise ProblemError(
                f"{name}: path is a {type(path).__name__}; of a Robot the frame has to be named: "
                "give a PositionTask, an OrientationTask or a PoseTask"
            )
        return RobotPath(
            arm=arm, task=path, t=t, horizon=horizon, parameters=tuple(parameters), name=name
        )
    if isinstance(path, SpaceTask):
        raise ProblemError(f"{name}: a {type(path).__name__} is for a Robot, the arm is planar")
    return ArmPath(
        arm=arm,
        position=path_position(path, t),
        t=t,
        horizon=horizon,
        parameters=tuple(parameters),
        name=name,
    )


def _model(arm: PlanarArm | Robot, theta: ca.SX, motion: _Motion, t: ca.SX) -> Model:
    in_space = isinstance(arm, Robot)
    units = arm.units if in_space else ("rad",) * arm.n
    return Model(
        name=arm.name if in_space else f"planar arm, {arm.n} links",
        x=theta,
        u=motion.control,
        f=motion.velocity,
        t=t,
        x_units=units,
        u_units=tuple(f"{unit}/s" for unit in units),
        # In space much is zero but for rounding at the start, and no measure of sizes.
        x_nominal=1.0 if in_space else None,
        u_nominal=1.0 if in_space else None,
    )


def _check_choices(name: str, cost: Cost, form: Form) -> None:
    if cost not in ("regularised", "raw"):
        raise ProblemError(f"{name}: cost = {cost!r}, neither regularised nor raw")
    if form not in ("null-space", "velocity"):
        raise ProblemError(f"{name}: form = {form!r}, neither null-space nor velocity")


def _check_kinds(
    name: str,
    posture_costs: Sequence[PostureCost],
    joint_bounds: Box | None,
    velocity_bounds: Box | None,
) -> None:
    for i, term in enumerate(posture_costs):
        check_instance(term, PostureCost, f"{name}: posture_costs[{i}]")
    for what, box in (("joint_bounds", joint_bounds), ("velocity_bounds", velocity_bounds)):
        if box is not None:
            check_instance(box, Box, f"{name}: {what}")


def _smoothness(
    distance_cost: DistanceCost | None,
    avoided: Sequence[Obstacle],
    posture_costs: Sequence[PostureCost],
) -> Literal[0, 1, 2]:
    """The least smooth term of the running cost."""
    terms = {term.smoothness for term in posture_costs}
    if distance_cost and avoided:
        terms |= {distance_cost.smoothness, *[obstacle.smoothness for obstacle in avoided]}
    return 0 if 0 in terms else 1 if 1 in terms else 2
