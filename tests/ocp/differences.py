"""Central finite differences: what every symbolic derivative is tested against."""

from collections.abc import Callable

import numpy as np

from tests.tolerances import STEP


def gradient(function: Callable[[np.ndarray], float], at: np.ndarray, step: float = STEP):
    """Return the derivative (n,) of a scalar function."""
    return jacobian(lambda v: np.array([function(v)]), at, step)[0]


def jacobian(
    function: Callable[[np.ndarray], np.ndarray], at: np.ndarray, step: float = STEP
) -> np.ndarray:
    """Return the derivative (m, n) of a vector function."""
    at = np.asarray(at, dtype=float)
    columns = [
        (np.ravel(function(at + e)) - np.ravel(function(at - e))) / (2 * step)
        for e in step * np.eye(len(at))
    ]
    return np.stack(columns, axis=1)
