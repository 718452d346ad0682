"""A delay in sampling intervals."""

from ocp.errors import ProblemError
from ocp.expressions import not_negative


def late_steps(delay: float, dt: float) -> int:
    """Return a delay in sampling intervals.

    Raises:
        ProblemError: if it is negative or no multiple of the interval.
    """
    steps = round(not_negative(delay, "delay [s]") / dt)
    if abs(steps * dt - delay) > 1e-9 * dt:
        raise ProblemError(f"delay = {delay} s is no multiple of the sampling interval of {dt} s")
    return steps
