"""What a backend that starts warm knows of its first iterate."""

from dataclasses import dataclass

import numpy as np

#: Changes of the controls of a first iterate below this, relative to 1 + abs(u), count as none.
UNCHANGED = 1e-6


@dataclass(frozen=True, eq=False)
class WarmStart:
    """The costates of a first iterate, or the run that has been made from there already.

    Attributes:
        costate: at the nodes, (N + 1, nx); None where the run has been made.
        ending: how that run has ended, a number of the backend; its answer is still in its memory.
        seconds: that it took [s].
    """

    costate: np.ndarray | None
    ending: int | None = None
    seconds: float = 0.0
