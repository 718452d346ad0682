"""A plain control law as a controller, so that it compares with a receding horizon."""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ocp.constraint import Box
from ocp.mpc.decision import ControlRefused, Decision, Outcome


@dataclass(frozen=True, eq=False, kw_only=True)
class Law:
    """u = law(x, t), saturated: a gain matrix, instantaneous robot control, anything.

    Its outcome is ``FEASIBLE``: nobody claims that it is optimal.

    Args:
        law: (x, t) -> input (m,).
        bounds: the input is clipped to them, and by how much is recorded.
        delay: time from measurement to effect [s].
    """

    law: Callable[[np.ndarray, float], ArrayLike]
    bounds: Box = field(default_factory=Box)
    delay: float = 0.0

    def reset(self) -> None:
        """Do nothing: a law has no memory."""

    def step(self, x: np.ndarray, t: float) -> Decision:
        """Evaluate the law.

        Raises:
            ControlRefused: if it returns no finite numbers.
        """
        started = perf_counter()
        given = np.array(self.law(x, t), dtype=float).reshape(-1)
        if not np.isfinite(given).all():
            raise ControlRefused(f"t = {t:g} s: the law returned {given} for x = {x}")
        return Decision(
            t=t,
            applies_at=t + self.delay,
            input=self.bounds.clip(given),
            outcome=Outcome.FEASIBLE,
            message="a control law, not a plan",
            clipped=float(self.bounds.excess(given).max(initial=0.0)),
            time_used=perf_counter() - started,
        )
