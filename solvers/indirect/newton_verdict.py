"""Status of Newton's last iterate: an extremal, or why it is none."""

from dataclasses import dataclass

import numpy as np

from ocp import Status
from solvers.indirect.boundary_value_problem import ExtremalProblem
from solvers.indirect.newton_iteration import NewtonResult
from solvers.indirect.second_order import concave_at
from solvers.indirect.shooting_segments import SegmentTrajectories, ShootingSchedule

# An eigenvalue of H_uu below minus this is no rounding error.
_CONCAVE = 1e-9
# A start beyond its bounds by less, relative to 1 + its size, is on them.
_OUTSIDE = 1e-6


@dataclass(frozen=True, eq=False)
class ExtremalMotion:
    """The trajectory of given unknowns.

    Attributes:
        paths: its segments.
        duration: final time minus t0 [s].
        t: (S M + 1,).
        x: states (S M + 1, nx).
        costate: (S M + 1, nx).
        u: controls, the minimisers of H, (S M + 1, nu).
        cost: running and terminal.
    """

    paths: SegmentTrajectories
    duration: float
    t: np.ndarray
    x: np.ndarray
    costate: np.ndarray
    u: np.ndarray
    cost: float

    @classmethod
    def of(
        cls, extremals: ExtremalProblem, v: np.ndarray, schedule: ShootingSchedule
    ) -> "ExtremalMotion":
        """Integrate from the unknowns ``v``."""
        at = extremals.shape.split(v, schedule.duration)
        paths = extremals.paths(at.z, schedule, at.duration)
        t, x, costate, u = extremals.trajectory(paths, schedule, at.duration)
        end = extremals.ocp.functions.terminal_cost(x[-1], t[-1], schedule.p_last)
        return cls(paths, at.duration, t, x, costate, u, float(paths.costs.sum()) + float(end))

    @property
    def exists(self) -> bool:
        """Whether it is finite and runs forwards in time."""
        parts = (self.t, self.x, self.costate, self.u, self.cost)
        return all(np.isfinite(a).all() for a in parts) and self.duration > 0.0


def verdict(
    extremals: ExtremalProblem,
    motion: ExtremalMotion,
    schedule: ShootingSchedule,
    last: NewtonResult,
    max_steps: int,
) -> tuple[Status, str]:
    """Return STATIONARY for a solution that may be a minimum, or what is wrong, in words.

    Args:
        extremals: the boundary value problem.
        motion: of Newton's last iterate.
        schedule: of the run.
        last: how Newton ended.
        max_steps: its limit.
    """
    status, message = _of_newton(last, max_steps)
    if not motion.exists:
        return Status.DIVERGED, message or "the cost is not finite along the extremal"
    if status is not Status.STATIONARY:
        return status, message
    if extremals.ocp.time_box.excess(np.array([motion.duration]))[0] > 0.0:
        return Status.FAILED, (
            f"the stationary final time, {motion.duration:.4g} s, is outside its bounds, which "
            "this method does not impose: use a direct method"
        )
    start = extremals.ocp.rows.start.largest_violation(motion.x[:1], motion.t[:1])
    if start.row is not None and start.amount > _OUTSIDE * (1.0 + abs(motion.x[0]).max()):
        return Status.FAILED, (
            f"the stationary start is outside its bounds ({start}), which this method does not "
            "impose: use a direct method"
        )
    concave = concave_at(extremals, motion.paths, schedule, motion.duration, below=-_CONCAVE)
    if concave is not None:
        return Status.FAILED, f"the control is no minimum of the Hamiltonian at t = {concave:.4g} s"
    return status, ""


def _of_newton(last: NewtonResult, max_steps: int) -> tuple[Status, str]:
    if last.converged:
        return Status.STATIONARY, ""
    if last.diverged:
        return Status.DIVERGED, last.in_words
    limit = last.steps >= max_steps
    return (Status.ITERATION_LIMIT if limit else Status.NO_PROGRESS), last.in_words
