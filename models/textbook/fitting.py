"""What problems of parameter estimation share: a first guess along the data."""

import numpy as np
from numpy.typing import ArrayLike

from ocp import Guess

# Equally spaced rows of a guess.
_ROWS = 101


def near_data(start: ArrayLike, times: np.ndarray, values: np.ndarray) -> Guess:
    """Return a guess that goes from the start through measurements of all states.

    Args:
        start: at time 0, (n,).
        times: increasing, the last one is the end of the horizon, (K,).
        values: (K, n).
    """
    at = np.linspace(0.0, times[-1], _ROWS)
    first = np.flatnonzero(times > 0.0)[0]
    t = np.append(0.0, times[first:])
    x = np.vstack([start, values[first:]])
    return Guess(x=np.stack([np.interp(at, t, column) for column in x.T], axis=1))
