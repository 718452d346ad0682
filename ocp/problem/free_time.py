"""A final time that the optimiser chooses."""

from dataclasses import dataclass

import numpy as np

from ocp.checks.arguments import check_positive
from ocp.checks.errors import ProblemError


@dataclass(frozen=True)
class FreeTime:
    """A final time the optimiser chooses.

    Args:
        guess: first guess of the duration [s].
        lower: shortest duration [s]; keep it positive.
        upper: longest duration [s].
    """

    guess: float
    lower: float = 1e-3
    upper: float = np.inf

    def __post_init__(self) -> None:
        """Check the three durations and their order."""
        check_positive(self.guess, "free final time: guess")
        check_positive(self.lower, "free final time: lower")
        check_positive(self.upper, "free final time: upper", finite=False)
        if not self.lower <= self.guess <= self.upper:
            raise ProblemError(
                f"free final time: 0 < lower <= guess <= upper is needed, "
                f"not {self.lower}, {self.guess}, {self.upper} [s]"
            )
