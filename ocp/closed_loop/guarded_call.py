"""Call a user's function; turn its failures into ``ControlRefused``."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.errors import OCPError
from ocp.closed_loop.decision import ControlRefused

ControlLaw = Callable[[np.ndarray, float], ArrayLike]

# What code may raise for numbers that it did not expect; a TypeError is a bug, and stays.
CALLBACK_ERRORS = (OCPError, ArithmeticError, ValueError, RuntimeError, LookupError, MemoryError)


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
