"""Newton's method with a line search: step lengths, shifts of the Hessian, when to stop."""

from dataclasses import dataclass, replace

import numpy as np

from ocp import Status
from solvers.direct.newton.newton_step import Iterate, Linearisation, NewtonDirection, NewtonStep

# Share of the predicted decrease that a step must bring [Nocedal & Wright 2006].
_ARMIJO = 1e-4
# Share of the merit function's slope that the defects alone must account for [ibid., 18.36].
_DEFECT_SHARE = 0.1
# Shortest step length; below it the shift grows.
_SHORTEST_STEP = 0.1
# Shift of H_uu relative to its size: the first one, its growth, the largest.
_SHIFT, _GROWTH, _LARGEST_SHIFT = 1e-4, 10.0, 1e12
# Decreases below this, relative to 1 + abs(m), are rounding errors.
_ROUNDING = 1e-13
# Standard deviation of the perturbation of a stationary point that is no minimum, relative to
# 1 + abs(u).
_PERTURBATION = 1e-3
# States and controls beyond this have diverged.
_DIVERGED = 1e12


@dataclass(frozen=True, eq=False)
class NewtonOutcome:
    """How the iteration ended.

    Attributes:
        status: the status.
        message: what went wrong, and where.
        linearisation: the last iterate, with its derivatives.
        costs: of the accepted iterates, the first one included.
        residuals: of the same.
        evaluations: how often all stages were evaluated.
        riccati_solves: how often the recursion was run.
    """

    status: Status
    message: str
    linearisation: Linearisation
    costs: np.ndarray
    residuals: np.ndarray
    evaluations: int
    riccati_solves: int

    def after(self, earlier: "NewtonOutcome") -> "NewtonOutcome":
        """Return this outcome with the work of an earlier one."""
        return replace(
            self,
            evaluations=self.evaluations + earlier.evaluations,
            riccati_solves=self.riccati_solves + earlier.riccati_solves,
        )


@dataclass(eq=False)
class _State:
    """Where the iteration is, and what it has taken so far.

    Attributes:
        here: linearisation at the current iterate.
        costs: of the accepted iterates.
        residuals: of the same.
        evaluations: of all stages.
        riccati_solves: runs of the recursion.
        penalty: mu of the merit function.
        was_perturbed: whether a stationary point has been left.
        unshifted: the direction without shift at the current iterate, once computed.
    """

    here: Linearisation
    costs: list[float]
    residuals: list[float]
    evaluations: int = 1
    riccati_solves: int = 0
    penalty: float = 0.0
    was_perturbed: bool = False
    unshifted: NewtonDirection | None = None

    def accept(self, there: Linearisation) -> None:
        """Go on from another iterate."""
        self.here, self.unshifted = there, None
        self.costs.append(there.measures.cost)
        self.residuals.append(there.residual)


@dataclass(frozen=True, eq=False)
class GlobalisedNewton:
    r"""Newton's method with a line search on the exact penalty function.

    .. math:: m(x, u) = J(x, u) + \mu \sum_k \lVert c_k \rVert_1

    A step is computed with the exact second derivative, and its feedback law applied to the
    model itself (``NewtonStep.trial_iterate``): the first full step closes all defects, and from
    then on the merit is the cost. Where a Q_uu is not positive definite, or the active bounds are
    not found, the shift sigma grows until they are, so that the step is a descent direction; where
    no step length is accepted it grows as well. The end is judged without it: it is a minimum only
    if all Q_uu are positive definite there (the second-order condition of the discretised
    problem). At a stationary point with negative curvature the controls are perturbed once; the
    second time it is reported.

    Attributes:
        step: the Newton step.
        schedule: t, h, p0, p1 of all stages, and the parameters at the end.
        tolerance: of the residual.
        max_iterations: most Newton steps.
    """

    step: NewtonStep
    schedule: list[np.ndarray]
    tolerance: float
    max_iterations: int

    def solve(self, start: Iterate) -> NewtonOutcome:
        """Iterate from a start."""
        first = self.step.linearise(start, self.schedule)
        state = _State(first, [first.measures.cost], [first.residual])
        status, message = self._iterate(state)
        return NewtonOutcome(
            status=status,
            message=message,
            linearisation=state.here,
            costs=np.array(state.costs),
            residuals=np.array(state.residuals),
            evaluations=state.evaluations,
            riccati_solves=state.riccati_solves,
        )

    def _iterate(self, state: _State) -> tuple[Status, str]:
        """Take steps until one of the ends is reached."""
        if not state.here.is_finite:
            return Status.DIVERGED, "cost or dynamics are not finite at the first iterate"
        for _ in range(self.max_iterations):
            if state.here.residual <= self.tolerance and not self._leave_saddle(state):
                return self._judge_stationary(state)
            if not self._advance(state):
                message = f"no step is accepted, residual {state.here.residual:.3g}"
                return Status.NO_PROGRESS, message
            at = state.here.at
            if max(np.abs(at.x).max(), np.abs(at.u).max()) > _DIVERGED:
                return Status.DIVERGED, "the cost may be unbounded below"
        if state.here.residual <= self.tolerance:
            return self._judge_stationary(state)
        message = f"residual {state.here.residual:.3g} after {self.max_iterations} Newton steps"
        return Status.ITERATION_LIMIT, message

    # -- one step ----------------------------------------------------------------------------

    def _advance(self, state: _State) -> bool:
        """Take a step that is accepted, with the smallest shift that allows one."""
        sigma, first = 0.0, _SHIFT * (state.here.measures.hessian_norm or 1.0)
        while sigma <= _LARGEST_SHIFT * first:
            step = self._direction(state, sigma)
            if step.is_convex and step.is_settled and self._line_search(state, step):
                return True
            sigma = _GROWTH * sigma or first
        return False

    def _line_search(self, state: _State, step: NewtonDirection) -> bool:
        """Accept the largest of the step lengths 1, 1/2, 1/4 ... that lowers the merit enough."""
        here, slope, defects = state.here, step.slopes.cost_slope, state.here.measures.defect_norm1
        # Below the largest costate the penalty is not exact; above it nothing is gained
        # [Powell 1978].
        enough = step.slopes.next_costate
        state.penalty = max(enough, (state.penalty + enough) / 2.0)
        if defects > 0.0:
            curvature = max(step.slopes.directional_curvature, 0.0)
            needed = (slope + curvature / 2.0) / ((1.0 - _DEFECT_SHARE) * defects)
            state.penalty = max(state.penalty, needed)
            slope -= state.penalty * defects
        before = here.measures.cost + state.penalty * defects
        slack, length = _ROUNDING * (1.0 + abs(before)), 1.0
        if slope > slack:  # possible with negative curvature towards bounds of clamped controls
            return False
        while length >= _SHORTEST_STEP:
            trial = self.step.trial_iterate(step, here, length, self.schedule)
            there = self._linearise(state, trial)
            merit = there.measures.cost + state.penalty * there.measures.defect_norm1
            if there.is_finite and merit <= before + _ARMIJO * length * slope + slack:
                state.accept(there)
                return True
            length /= 2.0
        return False

    def _direction(self, state: _State, sigma: float = 0.0) -> NewtonDirection:
        """Return the step from the current iterate; the one without a shift is kept."""
        if sigma == 0.0 and state.unshifted:
            return state.unshifted
        step = self.step.direction(state.here, sigma)
        state.riccati_solves += step.riccati_solves
        if sigma == 0.0:
            state.unshifted = step
        return step

    def _linearise(self, state: _State, at: Iterate) -> Linearisation:
        state.evaluations += 1
        return self.step.linearise(at, self.schedule)

    # -- the end -----------------------------------------------------------------------------

    def _leave_saddle(self, state: _State) -> bool:
        """Leave a stationary point with negative curvature, once."""
        if state.was_perturbed:
            return False
        if not self._direction(state).pivots.min() < -NewtonDirection.definite:
            return False
        at = state.here.at
        noise = np.random.default_rng(0).normal(size=at.u.shape)
        perturbed = at.u + _PERTURBATION * noise * (1.0 + np.abs(at.u))
        u = self.step.bounds.clip(perturbed.T).T
        there = self._linearise(state, Iterate(at.x, u, at.costate))
        if not there.is_finite:
            return False
        state.was_perturbed = True
        state.accept(there)
        return True

    def _judge_stationary(self, state: _State) -> tuple[Status, str]:
        """Test the second-order condition at a stationary point."""
        step = self._direction(state)
        if step.is_convex:
            return Status.SOLVED, ""
        pivots = step.pivots.min(axis=0)
        worst = int(np.argmin(pivots))
        negative = pivots[worst] < -NewtonDirection.definite
        kind = "no minimum" if negative else "perhaps no strict minimum"
        t = self.schedule[0][0, worst]
        return Status.STATIONARY, f"{kind}: Q_uu is not positive definite at t = {t:.4g} s"
