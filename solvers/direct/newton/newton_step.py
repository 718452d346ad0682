"""An iterate, its linearisation, and the Newton step from it within the bounds of the controls."""

from dataclasses import dataclass
from math import isfinite
from typing import ClassVar

import numpy as np

from ocp import OCP, Box, Integrator
from ocp.internal import BufferedFunction
from solvers.direct.newton.active_bounds import ActiveBounds
from solvers.direct.newton.newton_functions import (
    Measures,
    RiccatiSolution,
    StageEvaluation,
    StepSlopes,
    evaluate_stages,
    riccati_solve,
    trial_iterate,
)

# Most Riccati solves for one step: a good guess of the active bounds takes one to three.
_MAX_SOLVES = 16


@dataclass(frozen=True, eq=False)
class Iterate:
    """States (nx, N + 1), held controls (nu, N) and costates (nx, N + 1), with x_0 given."""

    x: np.ndarray
    u: np.ndarray
    costate: np.ndarray


@dataclass(frozen=True, eq=False)
class Linearisation:
    """An iterate with the derivatives of its stages.

    Attributes:
        at: the iterate.
        stages: derivatives and defects.
        measures: cost, and norms of defects and derivatives.
    """

    at: Iterate
    stages: StageEvaluation
    measures: Measures

    @property
    def residual(self) -> float:
        """Norm of the defects, or of the gradient relative to 1 + abs(p), whichever is larger.

        A defect c changes the cost by p'c; where this change, relative to 1 + abs(cost), is
        larger than the defect itself, it is taken instead.
        """
        m = self.measures
        worth = m.largest_costate / (1.0 + abs(m.cost))
        return max(m.defect_norm2 * max(1.0, worth), m.gradient_norm / (1.0 + m.largest_costate))

    @property
    def is_finite(self) -> bool:
        """Whether cost, defects and gradient are finite."""
        m = self.measures
        return isfinite(m.cost) and isfinite(m.defect_norm1) and isfinite(m.gradient_norm)


@dataclass(frozen=True, eq=False)
class NewtonDirection:
    """A step to the minimum of the quadratic model within the bounds of the controls.

    Attributes:
        law: for every stage (nu + nx, nx + 1), see ``backwards``, side by side.
        pivots: of every Q_uu among the free controls, relative to its diagonal, (nu, N).
        slopes: directional derivatives along the step, and the costates after it.
        is_settled: whether the active bounds are found: no free control leaves its bounds, none
            is clamped at a bound that the cost draws it away from.
        riccati_solves: how many it took.
    """

    law: np.ndarray
    pivots: np.ndarray
    slopes: StepSlopes
    is_settled: bool
    riccati_solves: int

    # A pivot below this share of its diagonal is zero up to rounding.
    definite: ClassVar[float] = 1e-10

    @property
    def is_convex(self) -> bool:
        """Whether the model has a minimum among the free controls, and the step leads there."""
        is_definite = bool(self.pivots.min() > self.definite)
        return is_definite and isfinite(self.slopes.directional_curvature)


@dataclass(frozen=True, eq=False)
class NewtonStep:
    """The Newton step of a problem on N intervals.

    Attributes:
        evaluate_stages: see ``newton_functions.evaluate_stages``.
        riccati_solve: see ``newton_functions.riccati_solve``.
        feedback_rollout: see ``newton_functions.trial_iterate``.
        bounds: of the controls.
    """

    evaluate_stages: BufferedFunction
    riccati_solve: BufferedFunction
    feedback_rollout: BufferedFunction
    bounds: Box

    @classmethod
    def of(cls, ocp: OCP, n: int, integrator: Integrator, *, fast: bool) -> "NewtonStep":
        """Build it; ``fast``: stage and recursion as machine code."""
        return cls(
            evaluate_stages=BufferedFunction(evaluate_stages(ocp, n, integrator, fast=fast)),
            riccati_solve=BufferedFunction(riccati_solve(ocp, n, fast=fast)),
            feedback_rollout=BufferedFunction(trial_iterate(ocp, n, integrator, fast=fast)),
            bounds=ocp.control_bounds,
        )

    def linearise(self, at: Iterate, schedule: list[np.ndarray]) -> Linearisation:
        """Evaluate all stages.

        Args:
            at: the iterate.
            schedule: t, h, p0, p1 of all stages, and the parameters at the end.
        """
        stages = StageEvaluation(*self.evaluate_stages(at.x, at.u, at.costate, *schedule))
        return Linearisation(at, stages, Measures(*stages.measures.ravel().tolist()))

    def direction(self, here: Linearisation, sigma: float = 0.0) -> NewtonDirection:
        """Minimise the quadratic model at an iterate within the bounds of the controls.

        Args:
            here: linearisation at the iterate.
            sigma: shift of every H_uu (Levenberg), in the space of the controls: with the defects
                closed it is added to the second derivative of the cost as a function of the
                controls alone, which is positive definite if and only if every Q_uu is.
        """
        if not self.bounds.is_active:
            free = np.zeros_like(here.at.u)
            return _direction(self._solve(here, sigma, free, free), 1, is_settled=True)
        active = ActiveBounds.at(here.at.u, here.stages.control_gradient, self.bounds)
        scale, solves = 1.0 + here.measures.largest_costate, 0
        while True:
            solution = self._solve(here, sigma, active.clamped, active.clamped_step)
            solves += 1
            check = active.check(solution.du, solution.clamped_gradient, scale)
            step = _direction(solution, solves, is_settled=not check.wrong.any())
            if step.is_settled or not step.is_convex or solves == _MAX_SOLVES:
                return step
            active = active.exchanged(check)

    def trial_iterate(
        self, step: NewtonDirection, here: Linearisation, length: float, schedule: list[np.ndarray]
    ) -> Iterate:
        """Return the iterate after a step of a length in [0, 1], by the nonlinear model itself."""
        at, defects = here.at, here.stages.defects
        inputs = (at.x, at.u, at.costate, length, step.law, defects, *schedule)
        return Iterate(*self.feedback_rollout(*inputs))

    def _solve(
        self, here: Linearisation, sigma: float, clamped: np.ndarray, clamped_step: np.ndarray
    ) -> RiccatiSolution:
        """Minimise the quadratic model with given clamped controls."""
        s = here.stages
        derivatives = (s.jacobian, s.gradient, s.hessian, s.end_gradient, s.end_hessian)
        given = (s.defects, here.at.costate, sigma, clamped, clamped_step)
        return RiccatiSolution(*self.riccati_solve(*derivatives, *given))


def _direction(solution: RiccatiSolution, solves: int, *, is_settled: bool) -> NewtonDirection:
    slopes = StepSlopes(*solution.slopes.ravel().tolist())
    return NewtonDirection(solution.law, solution.pivots, slopes, is_settled, solves)
