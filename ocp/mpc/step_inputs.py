"""What a decision is made from."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ocp.problem.parameters import ParameterValues
from ocp.solution.solution import Solution


@dataclass(slots=True, eq=False)
class StepInputs:
    """All that is known when a decision is due; not frozen, which would take twice as long to make.

    Attributes:
        t: when the state was measured [s].
        at: when the input acts [s].
        start: the state then (nx,), predicted where need be.
        is_measured: False where the measurement is missing; the last plan's state stands in, if
            there is one.
        plan: the last good one.
        values: parameters and signals of a horizon.
        parameters: the same by name.
        since: where that horizon begins [s]: at ``at``, or where the last plan began.
        parameters_known: False where nobody could say the parameters of the horizon from ``at`` on,
            and those of the last plan stand in as far as they reach.
        cold_start: whether the solver is not to start from the last plan.
        reasons: why the rungs above do not hold, in words; grows on the way down.
    """

    t: float
    at: float
    start: np.ndarray
    is_measured: bool
    plan: Solution | None
    values: ParameterValues
    parameters: Mapping[str, np.ndarray]
    since: float
    parameters_known: bool
    cold_start: bool
    reasons: list[str]

    @property
    def is_solvable(self) -> bool:
        """Whether a solver has what it needs."""
        return self.is_measured and self.parameters_known
