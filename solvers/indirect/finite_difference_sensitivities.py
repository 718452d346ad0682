"""The thesis' Algorithm 1: derivatives of the segments by perturbing their starts."""

import numpy as np

from solvers.indirect.boundary_value_problem import ExtremalProblem
from solvers.indirect.shooting_segments import SegmentTrajectories, ShootingSchedule


def varied(extremals: ExtremalProblem) -> range:
    """Components of z to vary: with one segment and a given start only the costates."""
    nx = extremals.shape.nx
    fixed = extremals.shape.segments == 1 and not extremals.ocp.has_free_start
    return range(nx if fixed else 0, 2 * nx)


def perturbed_slopes(
    extremals: ExtremalProblem,
    z: np.ndarray,
    paths: SegmentTrajectories,
    schedule: ShootingSchedule,
    duration: float,
    delta: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return what ``ExtremalProblem.segment_slopes`` does, by forward differences.

    Args:
        extremals: the boundary value problem.
        z: start of each segment (S, 2 nx).
        paths: from there.
        schedule: of the run.
        duration: of the horizon [s].
        delta: variation of each component of z, and of the duration.
    """
    in_z = np.zeros((*z.shape, z.shape[1]))
    for i in varied(extremals):
        moved = z + delta * np.eye(z.shape[1])[i]
        ends = extremals.paths(moved, schedule, duration).ends
        in_z[:, :, i] = (ends - paths.ends) / delta
    in_time = np.zeros_like(z)
    if extremals.shape.free_time:
        later = extremals.paths(z, schedule, duration + delta).ends
        in_time = (later - paths.ends) / delta
    return in_z, in_time
