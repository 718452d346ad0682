"""The numbers of one run."""

from dataclasses import dataclass

import numpy as np

from ocp.errors import ProblemError
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

    def __post_init__(self) -> None:
        """Refuse an initial time that is not finite."""
        if not np.isfinite(self.t0):
            raise ProblemError(f"t0 = {self.t0}, a finite time is needed")
