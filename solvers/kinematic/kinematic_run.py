"""The motion under a kinematic controller, also as a solution that the referee can evaluate."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ocp import OCP, ProblemError, Solution, Status, Work


@dataclass(frozen=True, eq=False)
class KinematicRun:
    """A motion under sampled velocities.

    Attributes:
        t: instants (N + 1,) [s].
        q: joint angles (N + 1, n) [rad].
        velocity: held from one instant to the next (N, n) [rad/s].
        errors: norm of each task's error at the instants, by name, (N + 1,); 0 for a task
            without a target.
        status: how the run ended.
        message: what and when, where the status alone does not say it.
    """

    t: np.ndarray
    q: np.ndarray
    velocity: np.ndarray
    errors: Mapping[str, np.ndarray]
    status: Status
    message: str

    def as_solution(self, ocp: OCP) -> Solution:
        """Return the motion as a solution of a problem whose control is dq/dt.

        That is the velocity form of the arm's problem: ``evaluate`` then says what the motion
        costs and how far it strays from its path. The costates are zero: no such controller
        knows any (``costates_along`` does).

        Args:
            ocp: with states q and controls dq/dt, over the time of the run.

        Raises:
            ProblemError: if states, controls or duration are others, or the run broke off.
        """
        n, m = self.q.shape[1], ocp.model
        if (m.nx, m.nu) != (n, n) or m.is_discrete:
            raise ProblemError(
                f"{ocp.name}: {m.nx} states and {m.nu} controls; a motion of {n} joints needs "
                "their angles as states and their velocities as controls"
            )
        if len(self.t) < 2 or abs(self.t[-1] - self.t[0] - ocp.duration) > 1e-9 * ocp.duration:
            raise ProblemError(
                f"{ocp.name}: lasts {ocp.duration} s, the run {self.t[-1] - self.t[0]:g} s"
            )
        return Solution(
            problem=ocp,
            solver="PrioritisedKinematics",
            status=self.status,
            message=self.message,
            t=self.t,
            x=self.q,
            x0=self.q[0],
            costate=np.zeros_like(self.q),
            u=self.velocity,
            cost=np.inf,
            work=Work(rollouts=1, jacobians=1, factorisations=len(self.velocity)),
        )
