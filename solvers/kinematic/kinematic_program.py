"""The compiled law of prioritised kinematics, at one instant and along a motion."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp import ProblemError, SolverError, Status
from ocp.internal import check_positive
from solvers.kinematic.hierarchy import Level, prioritised_velocity
from solvers.kinematic.kinematic_run import KinematicRun
from solvers.kinematic.pseudo_inverse import Inverse
from solvers.kinematic.task import Task

# Random configurations at which tasks that depend on each other everywhere are found.
_PROBES = 5
_DEPENDENT = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class KinematicProgram:
    """The compiled law.

    Attributes:
        tasks: in the order of priority.
        inverses: one for each.
        decoupled: whether damping keeps out of the null space.
        speed_limit: of every joint [rad/s].
        tolerance: by how much the first task with a target may be missed.
        levels: (q, t) -> activations, then J and desired_velocity of every task.
        error: (q, t) -> norm of each task's error.
    """

    tasks: tuple[Task, ...]
    inverses: tuple[Inverse, ...]
    decoupled: bool
    speed_limit: float
    tolerance: float
    levels: ca.Function
    error: ca.Function

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.tasks[0].q.numel()

    def velocity(self, q: ArrayLike, t: float = 0.0) -> np.ndarray:
        """Return dq/dt (n,) [rad/s].

        Args:
            q: joint angles (n,) [rad].
            t: time [s].

        Raises:
            ProblemError: if q has another size or is not finite.
            SolverError: naming the task that is not finite at q and t.
        """
        levels = self.at(self._checked(q), t)
        velocity = prioritised_velocity(levels, self.n, decoupled=self.decoupled)
        fastest = np.abs(velocity).max()
        limit = self.speed_limit
        return velocity * (limit / fastest) if fastest > limit else velocity

    def at(self, q: np.ndarray, t: float) -> list[Level]:
        """Return every task at one instant, the first with the highest priority."""
        active, *parts = [np.array(out) for out in self.levels(q, t)]
        levels = []
        for i, (task, inverse) in enumerate(zip(self.tasks, self.inverses, strict=True)):
            jacobian, desired_velocity = parts[2 * i], parts[2 * i + 1].ravel()
            alpha = float(active[i, 0])
            if not np.isfinite([alpha, *desired_velocity, *jacobian.ravel()]).all():
                raise SolverError(f"kinematics: task '{task.name}' is not finite at t = {t:.4g} s")
            levels.append(Level(jacobian, desired_velocity, alpha, inverse))
        return levels

    def run(
        self, q0: ArrayLike, *, duration: float, dt: float = 1e-3, t0: float = 0.0
    ) -> KinematicRun:
        """Let the arm move: each velocity is held for one sampling interval.

        Args:
            q0: start (n,) [rad].
            duration: [s], rounded to a whole number of intervals.
            dt: sampling interval [s].
            t0: initial time [s].

        Returns:
            the motion; ``MYOPIC`` where the first task with a target was done, ``INFEASIBLE`` where
            it was missed (a target outside the workspace, a singular configuration), ``DIVERGED``
            where a task stopped being finite: the motion then ends before.

        Raises:
            ProblemError: on numbers that are not positive or do not fit.
        """
        check_positive(duration, "kinematics: duration [s]")
        check_positive(dt, "kinematics: dt [s]")
        steps = max(1, round(duration / dt))
        t = t0 + duration * np.arange(steps + 1) / steps
        rows, velocities, message = [self._checked(q0)], [], ""
        for k in range(steps):
            try:
                velocities.append(self.velocity(rows[-1], t[k]))
            except SolverError as failure:
                message = str(failure)
                break
            rows.append(rows[-1] + (t[k + 1] - t[k]) * velocities[-1])
        q, t = np.array(rows), t[: len(rows)]
        errors = np.array(self.error.map(len(q))(q.T, t[None, :])).T
        status, why = self._verdict(t, errors)
        return KinematicRun(
            t=t,
            q=q,
            velocity=np.array(velocities).reshape(-1, self.n),
            errors={task.name: e for task, e in zip(self.tasks, errors.T, strict=True)},
            status=Status.DIVERGED if message else status,
            message=message or why,
        )

    def _verdict(self, t: np.ndarray, errors: np.ndarray) -> tuple[Status, str]:
        """Was the first target met? An arm may start off its path, but has to stay once there.

        A task without a target, as one that keeps off a limit, has nothing to miss.
        """
        limit, targets = self.tolerance, [i for i, task in enumerate(self.tasks) if task.has_target]
        if not targets:
            return Status.MYOPIC, ""
        error = errors[:, targets[0]]
        there = error <= limit
        missed = (np.cumsum(there) > 0) & ~there if there.any() else ~there
        if not missed.any():
            return Status.MYOPIC, ""
        k, name = int(missed.argmax()), self.tasks[targets[0]].name
        return Status.INFEASIBLE, (
            f"task '{name}' is missed by more than {limit:g} from t = {t[k]:.4g} s on, by "
            f"{error.max():.3g} at most: its target is out of reach, or the arm is singular"
        )

    def _checked(self, q: ArrayLike) -> np.ndarray:
        try:
            values = np.array(q, dtype=float).reshape(-1)
        except (TypeError, ValueError) as error:
            raise ProblemError(f"kinematics: q is not numeric: {q!r}") from error
        if values.size != self.n or not np.isfinite(values).all():
            raise ProblemError(f"kinematics: q = {values}, {self.n} finite numbers are needed")
        return values


def refuse_dependent(program: KinematicProgram) -> None:
    """Refuse rigid tasks whose rows depend on each other everywhere.

    Raises:
        ProblemError: naming the first such task.
    """
    rng, tasks = np.random.default_rng(0), program.tasks
    rigid = [i for i, task in enumerate(tasks) if task.is_rigid]
    probes = [program.levels(rng.uniform(-1.5, 1.5, program.n), 0.1 * k) for k in range(_PROBES)]
    for count in range(1, len(rigid) + 1):
        stacks = [np.vstack([np.array(p[1 + 2 * i]) for i in rigid[:count]]) for p in probes]
        stacks = [stack for stack in stacks if np.isfinite(stack).all()]
        if len(stacks[0] if stacks else []) > program.n or not stacks:
            return
        if all(_is_dependent(stack) for stack in stacks):
            raise ProblemError(
                f"kinematics: task '{tasks[rigid[count - 1]].name}' has rows that depend linearly "
                "on each other or on those of higher tasks, at every configuration; leave them "
                "out, or say that it may_conflict"
            )


def _is_dependent(stack: np.ndarray) -> bool:
    s = np.linalg.svd(stack, compute_uv=False)
    return bool(s[-1] <= _DEPENDENT * s[0])
