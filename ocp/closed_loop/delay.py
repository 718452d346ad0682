"""A delay in sampling intervals."""

from ocp.checks.arguments import check_not_negative
from ocp.checks.errors import ProblemError


def delay_steps(delay: float, dt: float) -> int:
    """Return a delay in sampling intervals.

    Raises:
        ProblemError: if it is negative or no multiple of the interval.
    """
    steps = round(check_not_negative(delay, "delay [s]") / dt)
    if abs(steps * dt - delay) > 1e-9 * dt:
        raise ProblemError(f"delay = {delay} s is no multiple of the sampling interval of {dt} s")
    return steps
