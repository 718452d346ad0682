"""Can this robot do this task from this start? Asked in numbers, before a solver is."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.robot.robot import Robot
from models.robot.tasks import SpaceTask
from models.sampling import sampled
from ocp import Parameter, ProblemError, Signal
from ocp.internal import Portable

# A task may begin with this error [m] or [rad].
_ON_PATH = 1e-9
# J counts as rank deficient below this singular value, as a share of its largest.
_SINGULAR = 1e-6
_BORDER = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotPath(Portable):
    """A task for a robot, as ``ArmPath`` is a path for an arm.

    Args:
        arm: who moves.
        task: what a frame of it does.
        t: the symbol of time [s].
        horizon: duration [s].
        parameters: those that the task may depend on, with their declared values.
        name: what messages call the problem.
    """

    arm: Robot
    task: SpaceTask
    t: ca.SX
    horizon: float
    parameters: tuple[Parameter | Signal, ...]
    name: str

    def error(self, theta: ca.SX) -> ca.SX:
        """Return the error of the task (m,)."""
        return self.task.error(self.arm, theta, self.t)

    def jacobian(self, theta: ca.SX) -> ca.SX:
        """Return J (m, n), the derivative of the error in θ where it is zero."""
        return ca.densify(self.task.jacobian(self.arm, theta, self.t))

    @property
    def desired_rate(self) -> ca.SX:
        """J dθ/dt (m,) that keeps the error."""
        return self.task.rate(self.t)

    def check(self, theta0: np.ndarray, *, must_start_on_path: bool) -> None:
        """Refuse what no controller can do.

        Args:
            theta0: start configuration (n,).
            must_start_on_path: whether the error has to be zero there.

        Raises:
            ProblemError: if nothing is redundant, the start is singular or has an error, or the
                task is not finite, has unknown symbols or leads out of reach (naming the time).
        """
        theta = ca.SX.sym("theta", self.arm.n)
        error = self.error(theta)
        if error.numel() >= self.arm.n:
            raise ProblemError(
                f"{self.name}: no redundancy: the task has {error.numel()} rows, "
                f"{self.arm.name} {self.arm.n} joints; leave rows out of the task"
            )
        at_start = ca.substitute(error, theta, ca.SX(ca.DM(theta0)))
        what = f"{self.name}: the task"
        _, errors = sampled(at_start, self.t, self.horizon, self.parameters, what)
        if not np.isfinite(errors[0]).all():
            raise ProblemError(
                f"{what} is not finite at t = 0 s, seen from theta0; an orientation must be less "
                "than half a turn away"
            )
        # From theta0 a task may well be half a turn away later: on the way the arm is elsewhere.
        times, rates = sampled(self.desired_rate, self.t, self.horizon, self.parameters, what)
        for k in np.flatnonzero(~np.isfinite(rates).all(axis=1))[:1]:
            raise ProblemError(f"{what} is not finite at t = {times[k]:g} s: so is its rate")
        self._refuse_gap(errors[0], must_start_on_path)
        self._refuse_singular(theta, theta0)
        self._refuse_unreachable()

    def _refuse_gap(self, error: np.ndarray, must_start_on_path: bool) -> None:
        gap = np.abs(error).max()
        if must_start_on_path and gap > _ON_PATH:
            raise ProblemError(
                f"{self.name}: the task starts with an error of {gap:.3g} (row "
                f"{int(np.abs(error).argmax())}) at theta0; move one of them, or take a "
                "correction > 0 or free_start=True"
            )

    def _refuse_singular(self, theta: ca.SX, theta0: np.ndarray) -> None:
        jacobian = ca.substitute(self.jacobian(theta), theta, ca.SX(ca.DM(theta0)))
        _, values = sampled(ca.vec(jacobian), self.t, self.horizon, self.parameters, self.name)
        sizes = np.linalg.svd(values[0].reshape(self.arm.n, -1).T, compute_uv=False)
        if sizes[-1] < _SINGULAR * max(1.0, sizes[0]):
            raise ProblemError(
                f"{self.name}: singular start: J(theta0) is without full rank (smallest singular "
                f"value {sizes[-1]:.2g}); bend the arm"
            )

    def _refuse_unreachable(self) -> None:
        place = self.task.place(self.t)
        if place is None:
            return
        times, points = sampled(place, self.t, self.horizon, self.parameters, self.name)
        origin, reach = _reach(self.arm, self.task.frame)
        distance = np.linalg.norm(points - origin, axis=1)
        for k in np.flatnonzero(distance > reach + _BORDER)[:1]:
            raise ProblemError(
                f"{self.name}: the task leaves the workspace at t = {times[k]:.4g} s: "
                f"{distance[k]:.4g} m from the first joint, '{self.task.frame}' comes at most "
                f"{reach:.4g} m away from it"
            )


def _reach(robot: Robot, frame: str) -> tuple[np.ndarray, float]:
    """Return where the first joint of a frame is (3,) [m], and how far away it can get [m].

    That is the sum of all lengths, so that what is nearer may still be out of reach.
    """
    body, pose = robot.tree.frames[frame]
    origin, length = pose.translation, 0.0
    for i in robot.tree.inwards(body):
        length += float(np.linalg.norm(origin)) + _slide(robot, i)
        origin = robot.tree.bodies[i].pose.translation
    return origin, length


def _slide(robot: Robot, body: int) -> float:
    """Return how far a body slides at most from where its joint is at 0 [m]."""
    each, limits = robot.tree.bodies[body], robot.limits
    if not each.slides:
        return 0.0
    ends = (limits.lower[each.coordinate], limits.upper[each.coordinate])
    return max(abs(each.factor * end + each.offset) for end in ends)
