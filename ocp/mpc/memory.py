"""What a controller knows from earlier steps."""

from dataclasses import dataclass

import numpy as np

from ocp.solution import Solution


@dataclass(frozen=True, eq=False)
class Memory:
    """What a controller knows from earlier steps.

    Attributes:
        plan: the last plan that was found good.
        input: the last input.
        pending: inputs that were decided but do not act yet, oldest first.
    """

    plan: Solution | None = None
    input: np.ndarray | None = None
    pending: tuple[np.ndarray, ...] = ()

    def after(self, given: np.ndarray | None, plan: Solution | None, steps_late: int) -> "Memory":
        """Return what is known after a step: its input, and its plan if there is a good one.

        A step that was refused has no input; a plan that came too late for it is kept.
        """
        if given is None:
            return Memory(plan or self.plan, self.input, self.pending)
        ahead = (*self.pending, given)
        return Memory(plan or self.plan, given, ahead[max(0, len(ahead) - steps_late) :])
