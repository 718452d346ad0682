"""Numbers that a user gives, checked once and named in the message."""

import numpy as np
from numpy.typing import ArrayLike

from ocp import ProblemError


def vector(values: ArrayLike, size: int, what: str) -> np.ndarray:
    """Return ``values`` as a read-only finite float vector (size,).

    Raises:
        ProblemError: on a wrong size, on NaN and on infinity, naming ``what``.
    """
    try:
        result = np.array(values, dtype=float).reshape(-1)
    except (TypeError, ValueError) as error:
        raise ProblemError(f"{what} is not numeric: {values!r}") from error
    if result.size != size:
        raise ProblemError(f"{what} has {result.size} entries, {size} are needed")
    if not np.isfinite(result).all():
        bad = int(np.flatnonzero(~np.isfinite(result))[0])
        raise ProblemError(f"{what}[{bad}] is {result[bad]}, a finite number is needed")
    result.flags.writeable = False
    return result


def at_least(value: float, lowest: float, what: str, *, strictly: bool = False) -> float:
    """Return ``value`` as a float if it is finite and not below ``lowest``.

    Raises:
        ProblemError: otherwise, naming ``what``.
    """
    number = float(vector(value, 1, what)[0])
    if number < lowest or (strictly and number == lowest):
        raise ProblemError(f"{what} = {number}, it must be {'>' if strictly else '>='} {lowest:g}")
    return number
