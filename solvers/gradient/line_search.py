"""How far a gradient method goes along a direction."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

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


Probe = Callable[[float], LineSearchTrial]


class StepRule(Protocol):
    """Chooses a point along a direction."""

    def advance(
        self, probe: Probe, cost: float, slope: float, first: float
    ) -> tuple[LineSearchTrial, float] | None:
        """Return the accepted trial and the step to it, or None if no step is acceptable.

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

    def advance(
        self, probe: Probe, cost: float, slope: float, first: float
    ) -> tuple[LineSearchTrial, float] | None:
        """Return the trial at ``alpha``."""
        return probe(self.alpha), self.alpha


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

    def advance(
        self, probe: Probe, cost: float, slope: float, first: float
    ) -> tuple[LineSearchTrial, float] | None:
        """Return the first trial that lies low enough, improved once by interpolation."""
        step = first
        for _ in range(self.most):
            trial = probe(step)
            minimum = _parabola_minimum(cost, slope, step, trial.cost)
            if trial.cost <= cost + self.decrease * step * slope:
                return _improved(probe, trial, step, minimum)
            step = float(np.clip(minimum, 0.1 * step, 0.5 * step))
        return None


def _improved(
    probe: Probe, trial: LineSearchTrial, step: float, minimum: float
) -> tuple[LineSearchTrial, float]:
    if abs(minimum - step) > 0.2 * step:
        other = probe(minimum)
        if other.cost < trial.cost:
            return other, minimum
    return trial, step


def _parabola_minimum(cost: float, slope: float, step: float, cost_there: float) -> float:
    """Where the parabola is lowest, at most ten steps away; a tenth where the cost is inf."""
    bend = cost_there - cost - slope * step
    if not np.isfinite(bend):
        return 0.1 * step
    return 10.0 * step if bend <= 0.0 else min(10.0 * step, step * (-slope * step / (2.0 * bend)))
