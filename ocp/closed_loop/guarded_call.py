"""Call a user's function; turn its failures into ``ControlRefused``."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ocp.closed_loop.decision import ControlRefused

ControlLaw = Callable[[np.ndarray, float], ArrayLike]

# A callback, a driver or a solver of somebody else may raise anything, and the loop has to go on:
# whatever it is becomes a reason. Ctrl-C and the end of the program are no Exception, and come out.
CALLBACK_ERRORS = (Exception,)


def guarded_call(rule: ControlLaw, what: str, x: np.ndarray, t: float) -> np.ndarray:
    """Return the finite input (m,) that a rule (x, t) -> input gives.

    Raises:
        ControlRefused: naming what it raised or returned instead.
    """
    try:
        given = rule(x, t)
    except CALLBACK_ERRORS as error:
        raise ControlRefused(f"{type(error).__name__} inside {what}: {error}") from error
    try:
        numbers = np.array(given, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        numbers = np.array([np.nan])
    if not np.isfinite(numbers).all():
        raise ControlRefused(f"{what} returned {given} for x = {x}")
    return numbers
