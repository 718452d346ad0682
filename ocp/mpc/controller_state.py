"""What a controller knows from earlier steps."""

from dataclasses import dataclass

import numpy as np

from ocp.solution.solution import Solution


@dataclass(frozen=True, eq=False)
class ControllerState:
    """What a controller knows from earlier steps.

    Attributes:
        plan: the last plan that was found good.
        input: the last input.
        pending: inputs that were decided but do not act yet, oldest first.
        misses: solver runs in a row that brought no good plan.
    """

    plan: Solution | None = None
    input: np.ndarray | None = None
    pending: tuple[np.ndarray, ...] = ()
    misses: int = 0

    @property
    def cold_start(self) -> bool:
        """Whether the solver should not start from the last plan, which may be what misleads it.

        One failure may be an accident, and a start afresh may lead elsewhere; after two, every
        other run starts afresh.
        """
        return self.misses > 0 and self.misses % 2 == 0

    def after(
        self, given: np.ndarray | None, plan: Solution | None, steps_late: int, *, tried: bool
    ) -> "ControllerState":
        """Return what is known after a step: its input, and its plan if there is a good one.

        Args:
            given: the input; None where the step was refused.
            plan: may have come too late for the step.
            steps_late: from a decision to its effect.
            tried: whether the solver was run.
        """
        misses = 0 if plan else self.misses + tried
        if given is None:
            return ControllerState(plan or self.plan, self.input, self.pending, misses)
        ahead = (*self.pending, given)
        return ControllerState(
            plan or self.plan, given, ahead[max(0, len(ahead) - steps_late) :], misses
        )
