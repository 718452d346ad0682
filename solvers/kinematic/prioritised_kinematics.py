"""Prioritised inverse kinematics: any number of tasks in strict order."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from ocp import ProblemError
from ocp.internal import check_instance, check_positive
from solvers.kinematic.kinematic_program import KinematicProgram, refuse_dependent
from solvers.kinematic.pseudo_inverse import Filtered, Inverse
from solvers.kinematic.task import Task


@dataclass(frozen=True, eq=False)
class PrioritisedKinematics:
    """Joint velocities that do the first task, the second as far as it lets them, and so on.

    A controller that knows the present instant only: no optimal control problem is solved,
    and nothing is promised about the future. Where a direction of a task is singular the
    inverse bounds the velocity it may cost; see ``Damped`` and ``Filtered``.

    Source: thesis 3.1, (3.5)-(3.19); [Nakamura 1991]; [Siciliano & Slotine 1991].

    Args:
        tasks: in the order of priority, all with the same q and t.
        damping: how J N is inverted, one for all tasks or one for each.
        decoupled: whether damping keeps out of the null space, so that no task disturbs a
            higher one; ``False``: (3.17) in (3.11) as the thesis has it.
        speed_limit: where a joint would be faster [rad/s], all are slowed down alike.
        tolerance: the first task with a target counts as missed by more than this, in its unit.

    Raises:
        ProblemError: if there is no task, if they have different q or t or the same name, or
            if the tasks above one have used up all joints (no redundancy left).
    """

    tasks: Sequence[Task]
    damping: Inverse | Sequence[Inverse] = field(default_factory=Filtered)
    decoupled: bool = True
    speed_limit: float = np.inf
    tolerance: float = 1e-2

    def __post_init__(self) -> None:
        """Check the tasks against each other."""
        if not isinstance(self.tasks, tuple | list) or not self.tasks:
            raise ProblemError("kinematics: tasks must be a tuple of at least one Task")
        tasks = tuple(self.tasks)
        for i, task in enumerate(tasks):
            check_instance(task, Task, f"kinematics: tasks[{i}]")
            if _symbols(task) != _symbols(tasks[0]):
                raise ProblemError(
                    f"kinematics: task '{task.name}' has other symbols q or t than "
                    f"'{tasks[0].name}'; write all tasks with the same ones"
                )
        names = [task.name for task in tasks]
        if len(set(names)) < len(names):
            raise ProblemError(f"kinematics: two tasks have the same name: {', '.join(names)}")
        check_instance(self.damping, (Inverse, tuple, list), "kinematics: damping")
        if len(self.inverses) != len(tasks):
            raise ProblemError(f"kinematics: {len(self.inverses)} inverses for {len(tasks)} tasks")
        for i, inverse in enumerate(self.inverses):
            check_instance(inverse, Inverse, f"kinematics: damping[{i}]")
        for name in ("speed_limit", "tolerance"):
            check_positive(getattr(self, name), f"kinematics: {name}", finite=False)
        _refuse_used_up(tasks)
        object.__setattr__(self, "tasks", tasks)

    def build(self) -> KinematicProgram:
        """Derive all Jacobians and compile them into one Function.

        Raises:
            ProblemError: naming the task that depends linearly on higher ones everywhere.
        """
        first = self.tasks[0]
        parts = [p for task in self.tasks for p in (task.jacobian, task.desired_velocity)]
        active = ca.vertcat(*[ca.SX(task.activation) for task in self.tasks])
        levels = ca.Function("levels", [first.q, first.t], [active, *map(ca.densify, parts)])
        errors = [ca.norm_2(ca.SX(task.error)) for task in self.tasks]
        error = ca.Function("error", [first.q, first.t], [ca.vertcat(*errors)])
        program = KinematicProgram(
            tasks=tuple(self.tasks),
            inverses=self.inverses,
            decoupled=self.decoupled,
            speed_limit=self.speed_limit,
            tolerance=self.tolerance,
            levels=levels,
            error=error,
        )
        refuse_dependent(program)
        return program

    @property
    def inverses(self) -> tuple[Inverse, ...]:
        """The inverse of each task."""
        given = self.damping
        return (given,) * len(self.tasks) if isinstance(given, Inverse) else tuple(given)


def _refuse_used_up(tasks: Sequence[Task]) -> None:
    used, n = 0, tasks[0].q.numel()
    for task in tasks:
        if used >= n:
            raise ProblemError(
                f"kinematics: no redundancy is left for task '{task.name}': the tasks above it "
                f"take all {n} joints"
            )
        used += task.rows if task.is_rigid else 0


def _symbols(task: Task) -> list[int]:
    return [s.element_hash() for s in ca.vertsplit(ca.vertcat(task.q, task.t))]
