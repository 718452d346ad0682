"""``StagewiseNewton``: Newton's method by a Riccati recursion, within bounds of the controls."""

from dataclasses import dataclass, field, replace

import numpy as np

from ocp import OCP, RK4, Grid, InitialGuess, Integrator, Status, UnsupportedProblem, Work
from ocp.internal import (
    MethodProgram,
    RunData,
    RunResult,
    ScalingSolver,
    check_flag,
    check_instance,
    check_intervals,
    check_positive,
    check_whole,
    refuse_compiled,
    refuse_free_ends,
    refuse_state_bounds,
)
from solvers.direct.first_trajectory import OTHER_STATES, FirstStates
from solvers.direct.newton.globalised_newton import GlobalisedNewton, NewtonOutcome
from solvers.direct.newton.newton_step import Iterate, NewtonStep
from solvers.direct.shooting_grid import ShootingGrid


@dataclass(frozen=True)
class StagewiseNewton(ScalingSolver):
    r"""Newton's method on the program of ``MultipleShooting``, solved by a Riccati recursion.

    The same transcription, hence the same optimal value: controls held on N intervals, one
    step of the integrator each, the defects between them closed at the end. One Newton step with
    the exact second derivative of the Lagrangian takes one evaluation of every stage and one
    recursion: effort linear in N. Where that derivative is not convex on the controls it is
    shifted (see ``NewtonStep.direction``), and steps are shortened by a line search on an exact
    penalty function.

    Controls at a bound are clamped inside the recursion, which is repeated, without new
    derivatives, until the active bounds are found (see ``ActiveBounds``): one to three times from
    the plan of the previous step of a controller, more from a poor guess. No iterate violates a
    bound, not by rounding either.

    ``SOLVED`` means a strict local minimum of the discretised problem: the unshifted
    recursion has only positive definite Q_uu there, among the controls that are not at a bound
    with a multiplier.

    Refuses state bounds and every constraint, a free start and a free final time.
    Source: [Dunn & Bertsekas 1989], [Hintermueller, Ito & Kunisch 2002].

    Args:
        intervals: number of intervals, with one held control each; a discrete-time problem
            brings its own number. Or a ``Grid`` of unequal ones.
        integrator: one-step method in each interval.
        tolerance: of the residual: norm of all defects, or of the Lagrangian's gradient relative
            to 1 + the largest costate; the gradient in a control is measured per width of its
            bounds, where that is less than one.
        max_iterations: most Newton steps.
        accuracy: largest accepted change of a state, relative to 1 + abs(x), when the step of an
            interval is halved; a solution beyond it is ``INACCURATE``.
        compiled: run stages and recursion as machine code; the first build takes seconds, see
            ``compiled``.
    """

    intervals: int | Grid = 75
    integrator: Integrator = field(default_factory=RK4)
    tolerance: float = 1e-9
    max_iterations: int = 300
    accuracy: float = 1e-2
    compiled: bool = False

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        check_intervals(self.intervals, "stagewise Newton: intervals")
        check_whole(self.max_iterations, "stagewise Newton: max_iterations")
        check_instance(self.integrator, Integrator, "stagewise Newton: integrator")
        check_positive(self.tolerance, "stagewise Newton: tolerance")
        check_positive(self.accuracy, "stagewise Newton: accuracy", finite=False)
        check_flag(self.compiled, "stagewise Newton: compiled")

    @property
    def success_accuracy(self) -> float:
        """The accepted relative error of a success."""
        return self.accuracy

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "StagewiseNewton":
        """Set what is left open; see ``Solver``."""
        return replace(self, compiled=compiled or self.compiled, judged=False, takes_knots=False)

    def prepare(self, ocp: OCP) -> "StagewiseNewtonProgram":
        """Build stages and recursion."""
        check_instance(ocp, OCP, "stagewise Newton: the problem")
        _refuse(ocp)
        refuse_compiled(ocp, compiled=self.compiled)
        nodes, fast = self.nodes(ocp, self.intervals), self.compiled
        step = NewtonStep.of(ocp, len(nodes) - 1, self.integrator, fast=fast)
        grid = ShootingGrid.of(ocp, nodes, self.integrator, fast=fast)
        return StagewiseNewtonProgram(self, ocp, step, grid)


def _refuse(ocp: OCP) -> None:
    if not ocp.model.nu:
        raise UnsupportedProblem(f"{ocp.name}: stagewise Newton needs a control, there is none")
    for c in ocp.constraints:
        raise UnsupportedProblem(
            f"{ocp.name}: stagewise Newton takes no {c.at} constraint ('{c.name}')"
        )
    refuse_state_bounds(ocp, "stagewise Newton")
    refuse_free_ends(ocp, "stagewise Newton")


@dataclass(frozen=True, eq=False)
class StagewiseNewtonProgram(MethodProgram):
    """A problem with its Newton step.

    Attributes:
        step: the Newton step.
        grid: for first iterates, and to check the integrator.
    """

    solver: StagewiseNewton
    step: NewtonStep
    grid: ShootingGrid

    def _solve(self, data: RunData, guess: InitialGuess | None) -> RunResult:
        """Solve for these data."""
        solver, ocp = self.solver, self.ocp
        schedule = self.grid.schedule(data, ocp.duration)
        stages_and_end = [*schedule, data.values.at(1.0)[0]]
        newton = GlobalisedNewton(
            self.step, stages_and_end, solver.tolerance, solver.max_iterations
        )
        outcome = newton.solve(self._first_iterate(data, guess, "tame"))
        if outcome.status is Status.DIVERGED:
            outcome = self._solve_from_others(newton, outcome, data, guess)
        last = outcome.linearisation
        t = data.t0 + self.grid.fractions * ocp.duration
        status, message = self._check_accuracy(outcome, schedule, t)
        return RunResult(
            status=status,
            message=message,
            t=t,
            x=last.at.x.T,
            costate=last.at.costate.T,
            u=last.at.u.T,
            cost=last.measures.cost if np.isfinite(last.measures.cost) else np.inf,
            residual=last.residual if last.is_finite else np.inf,
            iterations=len(outcome.costs) - 1,
            work=Work(outcome.evaluations, outcome.evaluations, outcome.riccati_solves),
            history={"cost": outcome.costs, "residual": outcome.residuals},
        )

    def _check_accuracy(
        self, outcome: NewtonOutcome, schedule: list[np.ndarray], t: np.ndarray
    ) -> tuple[Status, str]:
        """Return status and message; a success is ``INACCURATE`` if the integrator's error is."""
        if outcome.status.is_success:
            at = outcome.linearisation.at
            error, node = self.grid.error(at.x.T, at.u.T, schedule)
            if not error <= self.solver.accuracy:
                return Status.INACCURATE, f"a state moves by {error:.2g} at t = {t[node]:.4g} s"
        return outcome.status, outcome.message

    def _solve_from_others(
        self,
        newton: GlobalisedNewton,
        failed: NewtonOutcome,
        data: RunData,
        guess: InitialGuess | None,
    ) -> NewtonOutcome:
        """Solve from the start held and from the roll-out, until one succeeds."""
        begun = [self._first_iterate(data, guess, "tame").x]
        for source in OTHER_STATES:
            first = self._first_iterate(data, guess, source)
            if any(np.array_equal(first.x, x) for x in begun):
                continue
            begun.append(first.x)
            outcome = newton.solve(first)
            if outcome.status.is_success:
                return outcome.after(failed)
            failed = failed.after(outcome)
        return failed

    def _first_iterate(
        self, data: RunData, guess: InitialGuess | None, source: FirstStates
    ) -> Iterate:
        """Return the guess with x0 at the start; costates that it lacks are zero."""
        ocp, nodes = self.grid.ocp, self.grid.fractions
        x, u = self.grid.first_iterate(data, guess, ocp.duration, source)
        costate = guess.sample("costate", nodes, ocp.model.nx) if guess else None
        if costate is None:
            costate = np.zeros_like(x)
        x = np.vstack([data.x0, x[1:]])
        return Iterate(x.T, u.T, costate.T)
