"""A plan judged by a robot that follows it: computed torque, and what it takes."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.robot.robot import Robot
from models.robot.torque_checks import usable_limit
from ocp import RK4, ProblemError, Solution
from ocp.internal import check_instance, check_not_negative, check_positive


@dataclass(frozen=True, eq=False)
class TrackedMotion:
    """What a robot did that followed a plan.

    Attributes:
        t: instants (K + 1,) [s].
        q: where it was (K + 1, n) [rad] or [m].
        v: how fast (K + 1, n) [rad/s] or [m/s].
        wanted: what the controller asked for, held from one instant to the next (K, n) [N m] or
            [N]; what is beyond the limits of the robot was not given.
        error: q less the plan (K + 1, n) [rad] or [m].
        share: largest part of its limit of effort that each joint was asked for (n,); 0 where it
            has none. Above 1 the motors could not follow.
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    wanted: np.ndarray
    error: np.ndarray
    share: np.ndarray


def tracked_motion(
    robot: Robot,
    solution: Solution,
    *,
    plant: Robot | None = None,
    period: float = 1e-3,
    stiffness: float = 400.0,
    damping: float = 40.0,
) -> TrackedMotion:
    r"""Let a robot follow a plan of ``torque_ocp``, with feedback, and see what it takes.

    .. math:: \tau = M(q) \, (\ddot q_d + K_d (\dot q_d - \dot q) + K_p (q_d - q)) + h(q, \dot q)

    at every sampling instant from the measured state, by the model ``robot``; cut off at the limits
    and held, on the ``plant``, which is integrated by RK4. Torques that are replayed without
    feedback tell nothing of a robot: errors grow without bound.

    Args:
        robot: the model of the controller, without symbols.
        solution: of ``torque_ocp`` with accelerations among its controls, held or in steps.
        plant: the robot that moves, such as one with another payload; None: the model.
        period: sampling interval [s]; it is shortened to divide the horizon.
        stiffness: K_p [1/s^2].
        damping: K_d [1/s].

    Raises:
        ProblemError: if the plan is of another robot or without accelerations, or holds its
            controls in another way; if a payload has symbols, or a limit of effort is 0.

    Source: [Luh, Walker & Paul 1980] for the recursion that makes this cheap enough to control.
    """
    moving = robot if plant is None else plant
    for each, what in ((robot, "robot"), (moving, "plant")):
        check_instance(each, Robot, f"tracked motion: {what}")
        unknown = None if each.payload is None else each.payload.symbols
        if unknown is not None and unknown.numel():
            raise ProblemError(
                f"tracked motion: {what}: {', '.join(map(str, ca.vertsplit(unknown)))} of its "
                "payload is a symbol; give it a number: carrying(Payload(frame, 1.5))"
            )
    check_instance(solution, Solution, "tracked motion: solution")
    duration = solution.t[-1] - solution.t[0]
    steps = int(np.ceil(duration / check_positive(period, "tracked motion: period") - 1e-9))
    gains = [
        check_not_negative(gain, f"tracked motion: {name}")
        for gain, name in ((stiffness, "stiffness"), (damping, "damping"))
    ]
    t = np.linspace(0.0, duration, steps + 1)
    wanted = _plan(robot, solution, t)
    limits = usable_limit(robot, robot.limits.effort, 1.0, "tracked motion: effort")
    n, start = robot.n, solution.x[0]
    step = _step(robot, moving, duration / steps, gains[0], gains[1])
    states, efforts = step.mapaccum(steps)(start, wanted[:-1].T)
    x = np.vstack([start, np.array(states).T])
    asked = np.array(efforts).T.reshape(steps, n)
    share = np.abs(asked).max(axis=0) / limits
    return TrackedMotion(t, x[:, :n], x[:, n:], asked, x[:, :n] - wanted[:, :n], share)


def _plan(robot: Robot, solution: Solution, t: np.ndarray) -> np.ndarray:
    """Return q, q', q'' of the plan at instants, (K + 1, 3 n); accelerations are held."""
    n, nodes = robot.n, solution.t - solution.t[0]
    if solution.x.shape[1] != 2 * n or solution.u.shape[1] < 2 * n:
        raise ProblemError(
            f"tracked motion: the plan has {solution.x.shape[1]} states and {solution.u.shape[1]} "
            f"controls; {robot.name} needs one with {2 * n} states and {n} accelerations before "
            "its torques, as torque_ocp(form='acceleration') gives"
        )
    if solution.control_kind != "held":
        raise ProblemError(
            f"tracked motion: the controls of the plan are {solution.control_kind}, not held: "
            "take torque_ocp(steps=...)"
        )
    k = np.clip(np.searchsorted(nodes, t, side="right") - 1, 0, len(nodes) - 2)
    since = (t - nodes[k])[:, None]
    q, v = np.split(solution.x[k], 2, axis=1)
    a = solution.u[k, :n]
    return np.hstack([q + since * v + since**2 / 2.0 * a, v + since * a, a])


def _step(robot: Robot, plant: Robot, h: float, stiffness: float, damping: float) -> ca.Function:
    """Return one sampling interval: (state, q_d q_d' q_d'') -> (state after it, effort asked)."""
    n, limits = robot.n, ca.DM(robot.limits.effort)
    x, plan = ca.SX.sym("x", 2 * n), ca.SX.sym("plan", 3 * n)
    q, v = x[:n], x[n:]
    a = plan[2 * n :] + damping * (plan[n : 2 * n] - v) + stiffness * (plan[:n] - q)
    asked = robot.inverse_dynamics(q, v, a)
    given = ca.fmin(ca.fmax(asked, -limits), limits)

    def rate(x: ca.SX, _: ca.SX | float) -> ca.SX:
        return ca.vertcat(x[n:], plant.forward_dynamics(x[:n], x[n:], given))

    after = RK4()(rate, x, 0.0, h)
    return ca.Function("sampling_interval", [x, plan], [after, asked])
