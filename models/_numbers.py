"""Numbers that a user gives, checked once and named in the message."""

import numpy as np
from numpy.typing import ArrayLike

from ocp.internal import check_numbers


def vector(values: ArrayLike, size: int, what: str) -> np.ndarray:
    """Return ``values`` as ``ocp.numbers`` does; one number does not stand for all."""
    return check_numbers(values, size, what, repeat=False)
