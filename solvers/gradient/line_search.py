"""Step rules of a gradient method: a fixed step, or backtracking to a sufficient decrease."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from ocp.internal import check_positive, check_whole


@dataclass(frozen=True, eq=False)
class LineSearchTrial:
    """Controls and the trajectory they produce.

    Attributes:
        u: (N, nu).
        x: (N + 1, nx).
        cost: of the discretised problem; inf where the state blows up.
    """

    u: np.ndarray
    x: np.ndarray
    cost: float


class AcceptedStep(NamedTuple):
    """The trial that a rule accepts, and the step to it."""

    trial: LineSearchTrial
    step: float


Probe = Callable[[float], LineSearchTrial]


class StepRule(Protocol):
    """Chooses a point along a direction."""

    def advance(self, probe: Probe, cost: float, slope: float, first: float) -> AcceptedStep | None:
        """Return the accepted step, or None if no step is acceptable.

        Args:
            probe: step -> the trial there.
            cost: at step 0.
            slope: dJ/dstep at step 0, negative.
            first: a step that is likely to be good.
        """
        ...


@dataclass(frozen=True)
class FixedStep:
    """The thesis' rule: always the same step, whatever it does to the cost.

    Args:
        alpha: the step of (3.65).
    """

    alpha: float = 0.05

    def __post_init__(self) -> None:
        """Check the step."""
        check_positive(self.alpha, "fixed step: alpha")

    def advance(self, probe: Probe, cost: float, slope: float, first: float) -> AcceptedStep | None:
        """Return the trial at ``alpha``."""
        return AcceptedStep(probe(self.alpha), self.alpha)


@dataclass(frozen=True)
class Armijo:
    """Backtracking to a sufficient decrease; trial steps are minima of parabolas.

    The parabola through cost and slope here and the cost at the trial also says where the
    minimum along the line lies; an accepted step far from it is improved once. Source:
    [Nocedal & Wright 2006, 3.1, 3.5].

    Args:
        decrease: share of the decrease the slope promises that must be reached.
        most: trial steps.
    """

    decrease: float = 1e-4
    most: int = 40

    def __post_init__(self) -> None:
        """Check the constants."""
        check_positive(self.decrease, "Armijo: decrease", below=0.5)
        check_whole(self.most, "Armijo: most")

    def advance(self, probe: Probe, cost: float, slope: float, first: float) -> AcceptedStep | None:
        """Return the first trial that lies low enough, improved once by interpolation."""
        step = first
        for _ in range(self.most):
            trial = probe(step)
            minimum = _parabola_minimum(cost, slope, step, trial.cost)
            if trial.cost <= cost + self.decrease * step * slope:
                return _improved(probe, trial, step, minimum)
            step = float(np.clip(minimum, 0.1 * step, 0.5 * step))
        return None


def _improved(probe: Probe, trial: LineSearchTrial, step: float, minimum: float) -> AcceptedStep:
    if abs(minimum - step) > 0.2 * step:
        other = probe(minimum)
        if other.cost < trial.cost:
            return AcceptedStep(other, minimum)
    return AcceptedStep(trial, step)


def _parabola_minimum(cost: float, slope: float, step: float, cost_there: float) -> float:
    """Where the parabola is lowest, at most ten steps away; a tenth where the cost is inf."""
    curvature = cost_there - cost - slope * step
    if not np.isfinite(curvature):
        return 0.1 * step
    return (
        10.0 * step
        if curvature <= 0.0
        else min(10.0 * step, step * (-slope * step / (2.0 * curvature)))
    )
