"""The numbers of one run."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_real
from ocp.problem.ocp import OCP
from ocp.problem.parameters import ParameterValues


@dataclass(frozen=True, eq=False)
class RunData:
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
        """Refuse an initial time that is no finite number."""
        check_real(self.t0, "t0")

    @classmethod
    def of(
        cls,
        ocp: OCP,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
    ) -> "RunData":
        """Return the numbers of a run as ``Program.run`` takes them, checked.

        Raises:
            ProblemError: if start, time or parameters do not fit the problem.
        """
        return cls(ocp.start(x0), t0, ocp.parameter_values(parameters))
