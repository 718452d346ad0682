"""A delay in sampling intervals."""

import numpy as np

from ocp.errors import ProblemError


def late_steps(delay: float, dt: float) -> int:
    """Return a delay in sampling intervals.

    Raises:
        ProblemError: if it is negative or no multiple of the interval.
    """
    steps = round(delay / dt) if np.isfinite(delay) else -1
    if steps < 0 or abs(steps * dt - delay) > 1e-9 * dt:
        raise ProblemError(f"delay = {delay} s is no multiple of the sampling interval of {dt} s")
    return steps
