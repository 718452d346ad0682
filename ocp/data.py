"""The numbers of one run."""

from dataclasses import dataclass

import numpy as np

from ocp.parameters import ParameterValues


@dataclass(frozen=True, eq=False)
class Data:
    """What a run adds to the problem.

    Attributes:
        x0: start (nx,), or a guess of it.
        t0: initial time [s].
        values: parameters and signals.
    """

    x0: np.ndarray
    t0: float
    values: ParameterValues
