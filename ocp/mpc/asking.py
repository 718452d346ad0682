"""What other people's code answers, when it may raise or return anything."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ocp.errors import OCPError
from ocp.mpc.decision import ControlRefused

Rule = Callable[[np.ndarray, float], ArrayLike]

# What code may raise for numbers that it did not expect; a TypeError is a bug, and stays.
INSIDE = (OCPError, ArithmeticError, ValueError, RuntimeError, LookupError, MemoryError)


def asked(rule: Rule, what: str, x: np.ndarray, t: float) -> np.ndarray:
    """Return the finite input (m,) that a rule (x, t) -> input gives.

    Raises:
        ControlRefused: naming what it raised or returned instead.
    """
    try:
        given = rule(x, t)
    except INSIDE as error:
        raise ControlRefused(f"{type(error).__name__} inside {what}: {error}") from error
    try:
        numbers = np.array(given, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        numbers = np.array([np.nan])
    if not np.isfinite(numbers).all():
        raise ControlRefused(f"{what} returned {given} for x = {x}")
    return numbers
