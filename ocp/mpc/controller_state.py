"""What a controller knows from earlier steps."""

from typing import NamedTuple

import numpy as np

from ocp.solution.solution import Solution


class Seen(NamedTuple):
    """The last measurement that was whole, and what has acted since.

    Attributes:
        t: when it was made [s].
        x: the state (nx,).
        acting: the inputs from then on, one a sampling interval, oldest first.
    """

    t: float
    x: np.ndarray
    acting: tuple[np.ndarray, ...] = ()


class ControllerState(NamedTuple):
    """What a controller knows from earlier steps.

    Attributes:
        steps_late: sampling intervals from a decision to its effect.
        initial_input: acts until the first decision does (m,); None: unknown, or without a delay
            there is none.
        plan: the last plan that meets the constraints, or violated them least.
        input: the last input; None before the first decision.
        pending: inputs that were decided but do not act yet, oldest first.
        misses: solver runs in a row without a plan that meets the constraints.
        solver_raised: whether the solver raised at the last step: it is built again.
        seen: the last whole measurement, to count on from where one is missing; None: there was
            none, or it is not known what has acted since.
    """

    steps_late: int
    initial_input: np.ndarray | None
    plan: Solution | None
    input: np.ndarray | None
    pending: tuple[np.ndarray, ...]
    misses: int
    solver_raised: bool = False
    seen: Seen | None = None

    @classmethod
    def at_start(cls, steps_late: int, acting: np.ndarray | None) -> "ControllerState":
        """Return what is known before the first step, ``acting`` being the input until then."""
        # Without a delay the first decision acts at once.
        initial = acting if steps_late else None
        pending = () if acting is None else (acting,) * steps_late
        return cls(steps_late, initial, None, None, pending, 0)

    @property
    def last_input(self) -> np.ndarray | None:
        """The last input: decided, or acting until the first decision does."""
        return self.initial_input if self.input is None else self.input

    @property
    def cold_start(self) -> bool:
        """Whether the solver should not start from the last plan, which may mislead it.

        One failure may be an accident, and a cold start may lead elsewhere; after two, every
        other run starts cold.
        """
        return self.misses > 0 and self.misses % 2 == 0

    def after(
        self,
        given: np.ndarray | None,
        new_plan: Solution | None,
        *,
        solver_ran: bool,
        meets_constraints: bool = True,
        solver_raised: bool = False,
        seen: Seen | None = None,
    ) -> "ControllerState":
        """Return what is known after a step.

        Args:
            given: the input; None where the step was refused.
            new_plan: made at this step; it may be late for the step.
            solver_ran: whether the solver was run.
            meets_constraints: whether the new plan does; else it violates them least.
            solver_raised: whether the solver raised something.
            seen: the measurement of this step; None where it was missing.
        """
        plan = new_plan or self.plan
        misses = 0 if new_plan and meets_constraints else self.misses + solver_ran
        late, initial = self.steps_late, self.initial_input
        if given is None:
            return ControllerState(
                late, initial, plan, self.input, self.pending, misses, solver_raised, seen
            )
        ahead = (*self.pending, given)
        pending = ahead[max(0, len(ahead) - late) :]
        if seen is not None:
            since = Seen(seen.t, seen.x, ahead) if len(ahead) == late + 1 else None
        else:
            since = self.seen and self.seen._replace(acting=(*self.seen.acting, given))
        return ControllerState(late, initial, plan, given, pending, misses, solver_raised, since)
