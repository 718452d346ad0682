"""What a decision is made from."""

from typing import NamedTuple

import numpy as np

from ocp.parameters import ParameterValues
from ocp.solution import Solution


class Moment(NamedTuple):
    """All that is known when a decision is due.

    Attributes:
        t: when the state was measured [s].
        at: when the input acts [s].
        start: the state then (nx,), predicted where need be.
        is_measured: False where the measurement is missing; the last plan's state stands in, if
            there is one.
        plan: the last good one.
        values: parameters and signals of a horizon.
        since: where that horizon begins [s]: at ``at``, or where the last plan began.
        is_informed: False where nobody could say the parameters of the horizon from ``at`` on,
            and those of the last plan stand in as far as they reach.
        reasons: why the rungs above do not hold, in words; grows on the way down.
    """

    t: float
    at: float
    start: np.ndarray
    is_measured: bool
    plan: Solution | None
    values: ParameterValues
    since: float
    is_informed: bool
    reasons: list[str]
