"""Numbers that a user gives, checked once and named in the message."""

import numpy as np
from numpy.typing import ArrayLike

from ocp import ProblemError, numbers


def vector(values: ArrayLike, size: int, what: str) -> np.ndarray:
    """Return ``values`` as ``ocp.numbers`` does; one number does not stand for all."""
    return numbers(values, size, what, repeat=False)


def at_least(value: float, lowest: float, what: str, *, strictly: bool = False) -> float:
    """Return ``value`` as a float if it is finite and not below ``lowest``.

    Raises:
        ProblemError: otherwise, naming ``what``.
    """
    number = float(vector(value, 1, what)[0])
    if number < lowest or (strictly and number == lowest):
        raise ProblemError(f"{what} = {number}, it must be {'>' if strictly else '>='} {lowest:g}")
    return number
