"""Newton's method stage by stage: the quickest way to a minimum within bounds of the controls."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ocp import (
    OCP,
    RK4,
    InitialGuess,
    Integrator,
    Program,
    Solution,
    Solver,
    Status,
    UnsupportedProblem,
    Work,
)
from ocp.internal import RunData, check_instance, check_positive, check_whole
from solvers.direct.newton.globalised_newton import GlobalisedNewton
from solvers.direct.newton.newton_step import Iterate, NewtonStep
from solvers.direct.shooting_grid import ShootingGrid


@dataclass(frozen=True)
class StagewiseNewton(Solver):
    r"""Newton's method on the program of ``MultipleShooting``, solved by a Riccati recursion.

    The same transcription, hence the same optimal value: controls held on N intervals, one
    step of the integrator each, the gaps between them closed at the end. One Newton step with
    the exact second derivative of the Lagrangian costs one evaluation of every stage and one
    recursion: effort linear in N. Where that derivative is not convex on the controls it is
    shifted (see ``NewtonStep.step``), and steps are shortened by a line search on an exact
    penalty function.

    Controls at a bound are clamped inside the recursion, which is repeated, without new
    derivatives, until the right ones are (see ``ActiveBounds``): one to three times from a plan of
    the step before, more from afar. No iterate is ever out of bounds, not by rounding either.

    ``SOLVED`` stands for a strict local minimum of the discretised problem: the unshifted
    recursion has only positive definite Q_uu there, among the controls that are not at a bound
    with a multiplier.

    Refuses state bounds and every constraint, a free start and a free final time.
    Source: [Dunn & Bertsekas 1989], [Hintermueller, Ito & Kunisch 2002].

    Args:
        intervals: number of intervals, with one held control each; a discrete-time problem
            brings its own number.
        integrator: one-step method in each interval.
        tolerance: of the residual: norm of all gaps, or of the slopes of the Lagrangian
            relative to 1 + the largest costate; slopes in controls per width of their bounds,
            where that is less than one.
        max_iterations: most Newton steps.
        accuracy: largest accepted change of a state, relative to 1 + abs(x), when the step of an
            interval is halved; an answer beyond it is ``INACCURATE``.
        compiled: run stages and recursion as machine code; the first build takes seconds, see
            ``compiled``.
    """

    intervals: int = 75
    integrator: Integrator = field(default_factory=RK4)
    tolerance: float = 1e-9
    max_iterations: int = 300
    accuracy: float = 1e-2
    compiled: bool = False

    def __post_init__(self) -> None:
        """Check the options."""
        check_whole(self.intervals, "stagewise Newton: intervals")
        check_whole(self.max_iterations, "stagewise Newton: max_iterations")
        check_instance(self.integrator, Integrator, "stagewise Newton: integrator")
        for name in ("tolerance", "accuracy"):
            check_positive(getattr(self, name), f"stagewise Newton: {name}", finite=False)

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "StagewiseNewton":
        """Set what is left open; see ``Solver``."""
        return replace(self, compiled=True) if compiled else self

    def build(self, ocp: OCP) -> "StagewiseNewtonProgram":
        """Build stages and recursion."""
        check_instance(ocp, OCP, "stagewise Newton: the problem")
        _refuse(ocp)
        n, fast = ocp.steps or self.intervals, self.compiled
        step = NewtonStep.of(ocp, n, self.integrator, fast=fast)
        intervals = ShootingGrid.of(ocp, n, self.integrator, fast=fast)
        return StagewiseNewtonProgram(self, step, intervals)


def _refuse(ocp: OCP) -> None:
    for c in ocp.constraints:
        raise UnsupportedProblem(
            f"{ocp.name}: stagewise Newton takes no {c.at} constraint ('{c.name}')"
        )
    if ocp.state_bounds.is_active:
        raise UnsupportedProblem(f"{ocp.name}: stagewise Newton takes no state bounds")
    if ocp.has_free_time:
        raise UnsupportedProblem(f"{ocp.name}: stagewise Newton takes no free final time")


@dataclass(frozen=True, eq=False)
class StagewiseNewtonProgram(Program):
    """A problem with its Newton step.

    Attributes:
        solver: the options.
        step: the Newton step.
        intervals: for first guesses, and to check the integrator.
    """

    solver: StagewiseNewton
    step: NewtonStep
    intervals: ShootingGrid

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Solve for these data."""
        started = perf_counter()
        ocp = self.intervals.ocp
        data = RunData.of(ocp, x0, t0, parameters)
        schedule = self.intervals.schedule(data, ocp.duration)
        final = data.values.at(1.0)[0]
        solver = self.solver
        descent = GlobalisedNewton(
            self.step, [*schedule, final], solver.tolerance, solver.max_iterations
        )
        status = descent.descend(self._first_iterate(data, ocp.first_guess(guess)))
        found = descent.view
        x, u = found.at.x.T, found.at.u.T
        message = descent.message
        t = data.t0 + self.intervals.fractions * ocp.duration
        if status.is_success:
            error, node = self.intervals.error(x, u, schedule)
            if not error <= solver.accuracy:
                status = Status.INACCURATE
                message = f"a state moves by {error:.2g} at t = {t[node]:.4g} s"
        return Solution(
            problem=ocp,
            solver=repr(solver),
            status=status,
            message=message,
            t=t,
            x=x,
            x0=data.x0,
            costate=found.at.costate.T,
            u=u,
            cost=found.cost if np.isfinite(found.cost) else np.inf,
            residual=found.residual if found.is_finite else np.inf,
            iterations=len(descent.costs) - 1,
            work=Work(descent.views, descent.views, descent.sweeps),
            history={
                "cost": np.array(descent.costs),
                "residual": np.array(descent.residuals),
            },
            parameters=data.values.as_dict(),
            solve_time=perf_counter() - started,
        )

    def _first_iterate(self, data: RunData, guess: InitialGuess | None) -> Iterate:
        """Return the guess, from the measured start; costates are zero where there are none."""
        ocp, nodes = self.intervals.ocp, self.intervals.fractions
        x, u = self.intervals.first_iterate(data, guess, ocp.duration)
        costate = guess.sample("costate", nodes, ocp.model.nx) if guess else None
        if costate is None:
            costate = np.zeros_like(x)
        x = np.vstack([data.x0, x[1:]])
        return Iterate(x.T, u.T, costate.T)
