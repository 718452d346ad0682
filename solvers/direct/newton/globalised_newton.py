"""From Newton steps to a minimum: how far to go, what to do about curvature, when to stop."""

from dataclasses import dataclass

import numpy as np

from ocp import Status
from solvers.direct.newton.newton_step import Iterate, Linearisation, NewtonDirection, NewtonStep

# Share of the promised decrease that a step must bring [Nocedal & Wright 2006].
_ARMIJO = 1e-4
# Share of the merit function's slope that the gaps alone must account for [ibid., 18.36].
_GAPS = 0.1
# Shortest share of a step; then the shift grows.
_SHORTEST = 0.1
# Shift of H_uu relative to its size: the first one, its growth, the largest.
_SHIFT, _GROWTH, _MOST = 1e-4, 10.0, 1e12
# Decreases below this, relative to 1 + abs(m), are rounding.
_ROUNDING = 1e-13
# How far a stationary point that is no minimum is left behind, relative to 1 + abs(u).
_KICK = 1e-3
# Beyond this nothing is a trajectory any more.
_HUGE = 1e12


@dataclass(eq=False)
class GlobalisedNewton:
    r"""Newton's method with a line search on the exact penalty function.

    .. math:: m(x, u) = J(x, u) + \mu \sum_k \lVert c_k \rVert_1

    A step is computed with the exact second derivative, and its law followed by the model itself
    (``NewtonStep.moved``): the first full step closes all gaps, and from then on the merit is the
    cost. Where a Q_uu is not positive definite, or the controls at bounds are not found, the
    shift sigma grows until all of them are, so that the step leads downhill; where no share
    of a step is accepted it grows as well. The end is judged without it: it is a minimum only
    if all Q_uu are positive definite there (the second-order condition of the discretised
    problem). From a stationary point that has negative curvature the controls are pushed away
    once; the second time it is reported.

    Args:
        step: the function.
        schedule: the data of the stages.
        tolerance: of the residual.
        limit: most Newton steps.
    """

    step: NewtonStep
    schedule: list[np.ndarray]
    tolerance: float
    limit: int

    def __post_init__(self) -> None:
        """Nothing is known yet."""
        self.views, self.sweeps, self.message = 0, 0, ""
        self.costs: list[float] = []
        self.residuals: list[float] = []
        self._penalty, self._kicked = 0.0, False
        self._unshifted: NewtonDirection | None = None

    def descend(self, start: Iterate) -> Status:
        """Iterate from a start; ``view`` is where it ends and what that is worth."""
        self._stand_at(self._look(start))
        if not self.view.is_finite:
            self.message = "cost or dynamics are not finite at the first iterate"
            return Status.DIVERGED
        for _ in range(self.limit):
            if self.view.residual <= self.tolerance and not self._leaves():
                return self._verdict()
            if not self._advance():
                return self._stuck()
            if max(np.abs(self.view.at.x).max(), np.abs(self.view.at.u).max()) > _HUGE:
                self.message = "the cost may be unbounded below"
                return Status.DIVERGED
        if self.view.residual <= self.tolerance:
            return self._verdict()
        self.message = f"residual {self.view.residual:.3g} after {self.limit} Newton steps"
        return Status.ITERATION_LIMIT

    # -- one step ----------------------------------------------------------------------------

    def _advance(self) -> bool:
        """Take a step that is accepted, with as little shift as that needs."""
        sigma, first = 0.0, _SHIFT * (self.view.size or 1.0)
        while sigma <= _MOST * first:
            step = self._step(sigma)
            if step.is_convex and step.is_settled and self._search(step):
                return True
            sigma = _GROWTH * sigma or first
        return False

    def _search(self, step: NewtonDirection) -> bool:
        """Move by the largest share 1, 1/2, 1/4 ... of the step that is accepted."""
        view, slope = self.view, step.cost_slope
        # Below the largest costate the penalty is not exact; above it nothing is gained
        # [Powell 1978].
        enough = step.next_costate
        self._penalty = max(enough, (self._penalty + enough) / 2.0)
        if view.gaps > 0.0:
            needed = (slope + max(step.bend, 0.0) / 2.0) / ((1.0 - _GAPS) * view.gaps)
            self._penalty = max(self._penalty, needed)
            slope -= self._penalty * view.gaps
        before = view.cost + self._penalty * view.gaps
        slack, share = _ROUNDING * (1.0 + abs(before)), 1.0
        if slope > slack:  # curvature towards the bounds of clamped controls
            return False
        while share >= _SHORTEST:
            there = self._look(self.step.moved(step, view, share, self.schedule))
            merit = there.cost + self._penalty * there.gaps
            if there.is_finite and merit <= before + _ARMIJO * share * slope + slack:
                self._stand_at(there)
                return True
            share /= 2.0
        return False

    def _step(self, sigma: float = 0.0) -> NewtonDirection:
        """Return the step from here; the one without a shift is kept."""
        if sigma == 0.0 and self._unshifted:
            return self._unshifted
        step = self.step.step(self.view, sigma)
        self.sweeps += step.sweeps
        if sigma == 0.0:
            self._unshifted = step
        return step

    def _look(self, at: Iterate) -> Linearisation:
        self.views += 1
        return self.step.view(at, self.schedule)

    def _stand_at(self, view: Linearisation) -> None:
        self.view, self._unshifted = view, None
        self.costs.append(view.cost)
        self.residuals.append(view.residual)

    # -- the end -----------------------------------------------------------------------------

    def _leaves(self) -> bool:
        """Leave a stationary point that is no minimum, once."""
        if self._kicked or not self._step().pivots.min() < -NewtonDirection.definite:
            return False
        here = self.view.at
        push = _KICK * np.random.default_rng(0).normal(size=here.u.shape) * (1.0 + np.abs(here.u))
        pushed = self.step.bounds.clip((here.u + push).T).T
        view = self._look(Iterate(here.x, pushed, here.costate))
        if not view.is_finite:
            return False
        self._kicked = True
        self._stand_at(view)
        return True

    def _verdict(self) -> Status:
        if self._step().is_convex:
            return Status.SOLVED
        pivots = self._step().pivots.min(axis=0)
        worst = int(np.argmin(pivots))
        kind = (
            "no minimum"
            if pivots[worst] < -NewtonDirection.definite
            else "perhaps no strict minimum"
        )
        t = self.schedule[0][0, worst]
        self.message = f"{kind}: Q_uu is not positive definite at t = {t:.4g} s"
        return Status.STATIONARY

    def _stuck(self) -> Status:
        self.message = f"no step is accepted, residual {self.view.residual:.3g}"
        return Status.NO_PROGRESS
