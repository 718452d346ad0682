"""A plain control law as a controller, so that it compares with a receding horizon."""

from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from ocp.checks.arguments import check_callable, check_instance, check_not_negative
from ocp.closed_loop.decision import ControlRefused, Decision, InputSource
from ocp.closed_loop.guarded_call import ControlLaw, guarded_call
from ocp.problem.constraint import Box
from ocp.solution.shifted_plan import plan_controls
from ocp.solution.solution import Solution


@dataclass(frozen=True, eq=False, kw_only=True)
class FeedbackLaw:
    """u = law(x, t), saturated: a gain matrix, instantaneous robot control, anything.

    Its source is ``FEASIBLE``: it is not claimed to be optimal.

    Args:
        law: (x, t) -> input (m,).
        bounds: the input is clipped to them, and by how much is recorded.
        delay: time from measurement to effect [s].
    """

    law: ControlLaw
    bounds: Box = field(default_factory=Box)
    delay: float = 0.0

    def __post_init__(self) -> None:
        """Check what is given."""
        check_callable(self.law, "law: law")
        check_instance(self.bounds, Box, "law: bounds")
        check_not_negative(self.delay, "law: delay [s]")

    @classmethod
    def following(cls, plan: Solution) -> "FeedbackLaw":
        """Return the law that feeds a plan forward, whatever the state; its last input is held."""
        check_instance(plan, Solution, "law: the plan to follow")
        return cls(law=lambda x, t: plan_controls(plan, t))

    def reset(self, acting: np.ndarray | None = None) -> None:
        """Do nothing: a law has no memory."""

    def step(self, x: np.ndarray, t: float) -> Decision:
        """Evaluate the law.

        Raises:
            ControlRefused: if it raises, or returns no finite numbers.
        """
        started = perf_counter()
        try:
            given = guarded_call(self.law, "the law", x, t)
        except ControlRefused as refusal:
            raise ControlRefused(f"t = {t:g} s: {refusal}") from refusal
        return Decision(
            t=t,
            applies_at=t + self.delay,
            input=self.bounds.clip(given),
            source=InputSource.FEASIBLE,
            message="a control law, not a plan",
            clipped=float(self.bounds.excess(given).max(initial=0.0)),
            time_used=perf_counter() - started,
        )
