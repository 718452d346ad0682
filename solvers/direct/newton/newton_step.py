"""What is known at an iterate, and the Newton step from there within the bounds of the controls."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ocp import OCP, Box, Integrator
from ocp.internal import BufferedFunction
from solvers.direct.newton.active_bounds import ActiveBounds
from solvers.direct.newton.newton_functions import evaluate_stages, riccati_solve, trial_iterate


@dataclass(frozen=True, eq=False)
class Iterate:
    """States (nx, N + 1), held controls (nu, N) and costates (nx, N + 1), with x_0 given."""

    x: np.ndarray
    u: np.ndarray
    costate: np.ndarray


@dataclass(frozen=True, eq=False)
class Linearisation:
    r"""What is known at an iterate: how good it is, and the derivatives a step takes.

    With gaps c_k = F(x_k, u_k) - x_{k+1} and stage costs l the Lagrangian is

    .. math:: \sum_k l(x_k, u_k) + p_{k+1}' c_k + \varphi(x_N) - p_0' x_0.

    Attributes:
        at: the iterate.
        derivatives: of the stages and of the end, as ``newton_functions.sweep`` takes them.
        gap_by_stage: c (nx, N).
        pull: slopes of the Lagrangian in the controls (nu, N).
        cost: the sum of the stages' costs and the final one.
        gaps: sum of abs(c).
        gap: norm of c.
        slope: norm of the Lagrangian's slopes in states and controls, these as far as the bounds
            leave room: s (u - clip(u - slope / s)) with s = 1 + abs(p), where the bounds are
            wider than one; else their width is the unit of u.
        largest_costate: largest abs(p).
        size: largest element of H_uu and H_ux, to measure a shift by.
    """

    at: Iterate
    derivatives: tuple[np.ndarray, ...]
    gap_by_stage: np.ndarray
    pull: np.ndarray
    cost: float
    gaps: float
    gap: float
    slope: float
    largest_costate: float
    size: float

    @property
    def residual(self) -> float:
        """The gaps, or the slopes relative to 1 + abs(p), whichever is larger.

        A gap c changes the cost by p'c: where that, relative to 1 + abs(cost), is more than the
        gap itself, it counts.
        """
        worth = self.largest_costate / (1.0 + abs(self.cost))
        return max(self.gap * max(1.0, worth), self.slope / (1.0 + self.largest_costate))

    @property
    def is_finite(self) -> bool:
        """Whether the iterate means anything."""
        return bool(np.isfinite([self.cost, self.gaps, self.slope]).all())


@dataclass(frozen=True, eq=False)
class NewtonDirection:
    """A step to the minimum of the quadratic model within the bounds of the controls.

    Attributes:
        law: for every stage (nu + nx, nx + 1), see ``backwards``, side by side.
        pivots: of every Q_uu among the free controls, relative to its diagonal, (nu, N).
        is_settled: whether the clamped controls are the right ones: no free one leaves its
            bounds, none is held at a bound that it would leave.
        sweeps: how many recursions it took.
        next_costate: largest abs(p) after the step.
        cost_slope: slope of the cost along the step.
        bend: second derivative of the (shifted) Lagrangian along the step.
    """

    law: np.ndarray
    pivots: np.ndarray
    is_settled: bool
    sweeps: int
    next_costate: float
    cost_slope: float
    bend: float

    # A pivot below this share of its diagonal is zero but for rounding.
    definite: ClassVar[float] = 1e-10

    @property
    def is_convex(self) -> bool:
        """Whether the model has a minimum among the free controls, and the step leads there."""
        return bool(self.pivots.min() > self.definite) and bool(np.isfinite(self.bend))


@dataclass(frozen=True, eq=False)
class NewtonStep:
    """The Newton step of a problem on N intervals.

    Attributes:
        look: (x, u, costate, data) to what ``View`` consists of; the data are t, h, p0,
            p1 of all stages, and the parameters at the end.
        sweep: (derivatives, sigma, clamped, their moves) to what ``Step`` consists of.
        go: (x, u, costate, share, law, gaps, data) to x, u, costate.
        bounds: of the controls.
    """

    look: BufferedFunction
    sweep: BufferedFunction
    go: BufferedFunction
    bounds: Box

    @classmethod
    def of(cls, ocp: OCP, n: int, integrator: Integrator, *, fast: bool) -> "NewtonStep":
        """Build it; ``fast``: stage and recursion as machine code."""
        looking, going = (
            make(ocp, n, integrator, fast=fast) for make in (evaluate_stages, trial_iterate)
        )
        return cls(
            look=BufferedFunction(looking),
            sweep=BufferedFunction(riccati_solve(ocp, n, fast=fast)),
            go=BufferedFunction(going),
            bounds=ocp.control_bounds,
        )

    def view(self, at: Iterate, schedule: list[np.ndarray]) -> Linearisation:
        """Evaluate all stages.

        Args:
            at: the iterate.
            schedule: t, h, p0, p1 of all stages, and the parameters at the end.
        """
        *derivatives, gap, pull, numbers = self.look(at.x, at.u, at.costate, *schedule)
        known = (*derivatives, gap, at.costate)
        return Linearisation(at, known, gap, pull, *numbers.ravel().tolist())

    def step(self, view: Linearisation, sigma: float = 0.0) -> NewtonDirection:
        """Minimise the quadratic model at an iterate.

        Args:
            view: of the iterate.
            sigma: shift of every H_uu (Levenberg), in the space of the controls: with the gaps
                closed it is added to the second derivative of the cost as a function of the
                controls alone, which is positive definite if and only if every Q_uu is.
        """
        if not self.bounds.is_active:
            none = np.zeros_like(view.at.u)
            law, pivots, _, _, numbers = self.sweep(*view.derivatives, sigma, none, none)
            return NewtonDirection(law, pivots, True, 1, *numbers.ravel().tolist())
        clamped, sweeps = ActiveBounds.at(view.at.u, view.pull, self.bounds), 0
        while True:
            chosen = clamped.chosen, clamped.moves
            law, pivots, du, slope, numbers = self.sweep(*view.derivatives, sigma, *chosen)
            sweeps += 1
            fits = clamped.suits(du, slope, 1.0 + view.largest_costate)
            step = NewtonDirection(law, pivots, fits, sweeps, *numbers.ravel().tolist())
            if fits or not step.is_convex or not clamped.exchange():
                return step

    def moved(
        self, step: NewtonDirection, view: Linearisation, share: float, schedule: list[np.ndarray]
    ) -> Iterate:
        """Return where a share of the step from an iterate leads, by the model itself."""
        at, laws = view.at, (step.law, view.gap_by_stage)
        return Iterate(*self.go(at.x, at.u, at.costate, share, *laws, *schedule))
