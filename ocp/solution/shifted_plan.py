"""An earlier plan, seen from a later instant: what is left of it, and as a first guess."""

from typing import NamedTuple

import numpy as np

from ocp.checks.errors import ProblemError
from ocp.solution.solution import SAME_INSTANT, Solution


class ShiftedPlan(NamedTuple):
    """A plan moved to start later, as a first guess for the same horizon.

    States, controls and costates are read off at the later instants, those that a solver asks
    for and no others. Beyond its end the plan goes on as it ended: states along their last
    slope, controls held, costates at their final value (what the transversality condition makes
    them anyway).

    Attributes:
        plan: the earlier one.
        t0: where it is to start [s].
    """

    plan: Solution
    t0: float

    @classmethod
    def of(cls, guess: object) -> "ShiftedPlan | None":
        """Return a guess as an earlier plan, a solution as one that begins where it did.

        None where it is neither.
        """
        if isinstance(guess, Solution):
            return cls(guess, guess.t.item(0))
        return guess if isinstance(guess, ShiftedPlan) else None

    @property
    def duration(self) -> None:
        """Nothing: the horizon is fixed."""

    def sample(self, part: str, fractions: np.ndarray, width: int) -> np.ndarray:
        """Return x, u or costate at fractions of the horizon, (len(fractions), width)."""
        plan, times = self.plan, self.t0 + fractions * self.plan.duration
        match part:
            case "x":
                rows = _along(times, plan.t, plan.x)
            case "u":
                rows = plan_controls(plan, times)
            case _:
                rows = _along(_within(times, plan.t), plan.t, plan.costate)
        if rows.shape[1] != width:
            raise ProblemError(f"guess: the plan has {rows.shape[1]} of {part}, {width} are needed")
        return rows


def plan_controls(plan: Solution, times: np.ndarray | float) -> np.ndarray:
    """Return the controls of a plan at one instant (nu,), or at some (K, nu), the last one held.

    An extremal's are interpolated from its nodes: a guess needs no more, and the minimising
    control would have to be solved for.
    """
    if plan.control_kind == "held":
        # A new plan is asked for its first control at every step: nothing to look for.
        if isinstance(times, float) and times == plan.t[0]:
            return plan.u[0]
        return plan.u[_interval(times + SAME_INSTANT * plan.duration, plan.t)]
    if plan.control_kind == "polynomial":
        values = plan.pieces.at(np.atleast_1d(times))
        return values if np.ndim(times) else values[0]
    return _along(_within(times, plan.t), plan.t, plan.u)


def _within(times: np.ndarray | float, nodes: np.ndarray) -> np.ndarray:
    return np.minimum(np.maximum(times, nodes[0]), nodes[-1])


def _along(times: np.ndarray | float, nodes: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Interpolate all columns at once, beyond the ends along the outermost slopes."""
    left = _interval(times, nodes)
    right = left + 1
    start, below = nodes[left], rows[left]
    share = (times - start) / (nodes[right] - start)
    return below + share[..., None] * (rows[right] - below)


def _interval(times: np.ndarray | float, nodes: np.ndarray) -> np.ndarray | np.intp:
    """Return the interval that each instant lies in; the outermost ones have no end."""
    return nodes[1:-1].searchsorted(times, side="right")
