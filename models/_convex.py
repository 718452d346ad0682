"""Corners that a user gives for a convex polygon."""

import numpy as np
from numpy.typing import ArrayLike

from ocp import ProblemError


def counter_clockwise(corners: ArrayLike) -> np.ndarray:
    """Return the corners (k, 2) in order, read-only.

    Raises:
        ProblemError: on fewer than three, repeated ones, NaN, and on what is not convex.
    """
    try:
        points = np.array(corners, dtype=float)
    except (TypeError, ValueError) as error:
        raise ProblemError(f"polygon: corners are not numeric: {corners!r}") from error
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
        raise ProblemError(f"polygon: corners have shape {points.shape}, (k >= 3, 2) is needed")
    if not np.isfinite(points).all():
        raise ProblemError("polygon: a corner is not finite")
    edges = np.roll(points, -1, axis=0) - points
    lengths = np.linalg.norm(edges, axis=1)
    if not lengths.all():
        raise ProblemError(f"polygon: corner[{int(lengths.argmin())}] is there twice in a row")
    before, after = np.roll(edges, 1, axis=0), edges
    turns = np.arctan2(
        before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1)
    )
    turns = turns if turns.sum() > 0.0 else -turns
    # Once around, and never back: a star turns twice around, a flat one not at all.
    if turns.min() < -1e-9 or turns.max() > np.pi - 1e-9 or abs(turns.sum() - 2 * np.pi) > 1e-6:
        raise ProblemError(
            f"polygon: not convex at corner[{int(turns.argmin())}]; split it into convex ones"
        )
    area = points[:, 0] @ np.roll(points[:, 1], -1) - points[:, 1] @ np.roll(points[:, 0], -1)
    points = points if area > 0.0 else points[::-1].copy()
    points.flags.writeable = False
    return points
