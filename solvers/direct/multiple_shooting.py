"""Direct multiple shooting: the problem on a grid, solved by an interior-point method."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import ClassVar, Literal

import numpy as np

from ocp import OCP, RK4, Grid, InitialGuess, Integrator, Program, Status
from ocp.internal import (
    BlockingSolver,
    Epigraph,
    FeedbackMethodProgram,
    RunData,
    RunResult,
    Transcription,
    check_flag,
    check_instance,
    check_intervals,
    check_positive,
    epigraph,
    least_violating,
    refuse_compiled,
)
from solvers.direct.first_trajectory import FirstStates, first_duration, other_starts
from solvers.direct.native.warm_run import WarmRun
from solvers.direct.nlp_backends import NativeNlp, Nlp, NlpBackend
from solvers.direct.nlp_outcome import NlpOutcome
from solvers.direct.nlp_result import NlpResult
from solvers.direct.nlp_run import NlpRun
from solvers.direct.shooting_grid import ShootingGrid
from solvers.direct.warm_start import WarmStart
from solvers.direct.weak_method import weak_method


@dataclass(frozen=True)
class MultipleShooting(BlockingSolver):
    """The direct baseline, for every kind of problem that can be described.

    Without states in the guess it starts from the roll-out of the controls, or from the start held
    where that explodes. ``SOLVED`` is said by the unscaled optimality conditions; where the backend
    stopped before its tolerance, a residual up to 5e-4 is accepted, and the message gives it.

    Source: [Bock & Plitt 1984]; backends [Waechter & Biegler 2006], [Vanroye et al. 2023].

    Args:
        intervals: number of intervals, with one held control each, equal but for the knots of
            signals, which are nodes where there are intervals enough; a discrete-time problem
            brings its own number. Or a ``Grid`` of unequal ones.
        integrator: one-step method in each interval.
        backend: ``"ipopt"``; ``"fatrop"``, which exploits the stages; or ``"native"``, which does
            so in C that is generated for the problem: it needs a C compiler, starts warm from a
            guess with costates, and takes no ``blocks``.
        tolerance: of the optimality conditions.
        max_iterations: limit of the backend.
        accuracy: largest accepted change of a state, relative to 1 + abs(x), when the step of an
            interval is halved; a solution beyond it is ``INACCURATE``.
        verbose: let the backend print; the native one prints nothing.
        compiled: run the stages as machine code; the first build takes seconds, see ``compiled``.
        time_limit: for each run of the backend, of which a solve may take some [s]: other first
            iterates are not tried once it has passed; inf:
            unlimited; None: unlimited, but 10 s in ``MPC``. IPOPT and the native backend return
            their iterate, ``TIME_LIMIT``. fatrop may never return from a problem that cannot be
            solved; with a limit it runs in a process of its own, and a process that is ended
            returns no iterate: ``FAILED``.
        feasibility_restoration: after a failure, find the trajectory that violates the
            constraints least: it tells whether the problem is infeasible, and is a better first
            iterate if it is not; after that, try other first iterates. After a failure of the
            native backend IPOPT runs, before all that. Each may cost 300
            iterations; turn it off in a controller with a deadline.
        blocks: over how many intervals each control is held; the last one goes on to the end, so
            that ``(1, 1, 2)`` leaves three moves (a control horizon); none: each over one.
    """

    takes_phases: ClassVar[bool] = True

    intervals: int | Grid = 75
    integrator: Integrator = field(default_factory=RK4)
    backend: Literal["ipopt", "fatrop", "native"] = "ipopt"
    tolerance: float = 1e-9
    max_iterations: int = 300
    accuracy: float = 1e-2
    verbose: bool = False
    compiled: bool = False
    time_limit: float | None = None
    feasibility_restoration: bool = True

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        check_intervals(self.intervals, "multiple shooting: intervals")
        check_instance(self.integrator, Integrator, "multiple shooting: integrator")
        check_positive(self.accuracy, "multiple shooting: accuracy", finite=False)
        check_flag(self.compiled, "multiple shooting: compiled")
        check_flag(self.feasibility_restoration, "multiple shooting: feasibility_restoration")
        self.nlp_backend.check()

    @property
    def nlp_backend(self) -> NlpBackend:
        """The backend with its options."""
        return NlpBackend(
            name=self.backend,
            tolerance=self.tolerance,
            max_iterations=self.max_iterations,
            verbose=self.verbose,
            time_limit=np.inf if self.time_limit is None else self.time_limit,
        )

    @property
    def success_accuracy(self) -> float:
        """The accepted relative error of a success."""
        return self.accuracy

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "MultipleShooting":
        """Set what is left open, and nothing that takes a second run; see ``Solver``."""
        limit = time_limit if self.time_limit is None else self.time_limit
        return replace(
            self,
            compiled=compiled or self.compiled,
            time_limit=limit,
            judged=False,
            takes_knots=False,
            feasibility_restoration=False,
        )

    def smooth_form(self, ocp: OCP) -> Epigraph | None:
        """Replace the kinks that a held control decides."""
        return epigraph(ocp, held=True)

    def least_violating(self, ocp: OCP) -> Program | None:
        """Build the problem with a slack for its hard rows; see ``Solver``."""
        return least_violating(self.blocking(ocp).unjudged(), ocp)

    def prepare(self, ocp: OCP) -> "MultipleShootingProgram":
        """Transcribe the problem and set the backend up."""
        refuse_compiled(ocp, compiled=self.compiled)
        nodes = self.nodes(ocp, self.intervals)
        n = len(nodes) - 1
        blocks = self.blocks_on(ocp, n)
        transcription = Transcription(
            ocp, n, self.integrator, self.compiled, nodes=nodes, blocks=blocks
        )
        grid = ShootingGrid.of(ocp, nodes, self.integrator, fast=self.compiled)
        nlp = self.nlp_backend.build(transcription)
        return MultipleShootingProgram(self, ocp, transcription, grid, nlp)


@dataclass(frozen=True, eq=False)
class MultipleShootingProgram(FeedbackMethodProgram):
    """A transcribed problem with its backend.

    Attributes:
        transcription: the problem on its grid.
        grid: for first iterates, and to check the integrator.
        nlp: the backend, set up.
    """

    solver: MultipleShooting
    transcription: Transcription
    grid: ShootingGrid
    nlp: Nlp

    def _begun(
        self, data: RunData, guess: InitialGuess | None
    ) -> RunResult | Callable[[], RunResult]:
        """Solve from an earlier plan, or return what solves; see ``WarmRun``."""
        self.forget_feedback()
        warm = self._warm_run(data, guess) if self._warm_run and guess else None
        if isinstance(warm, RunResult):
            return warm
        return partial(self._solve, data, guess, warm)

    def _solve(
        self, data: RunData, guess: InitialGuess | None, warm: WarmStart | None = None
    ) -> RunResult:
        """Solve for these data, in the phases of ``NlpRun``; go on after a warm run, if any."""
        ocp, duration = self.ocp, first_duration(self.ocp, guess)

        def first(duration: float, source: FirstStates) -> np.ndarray:
            return self.transcription.join(*self._iterate(data, guess, duration, source))

        others = partial(other_starts, ocp, guess, duration, first)
        w0 = first(duration, "tame")
        outcome = self._nlp_run.solve(w0, data, others, warm or self._warm_start(guess))
        if outcome.is_undefined and not self.transcription.start_is_smooth(w0, data):
            outcome = self._nlp_run_without_slope.solve(w0, data, others).after(outcome)
            return self._result(data, outcome, self._without_slope)
        return self._result(data, outcome, self.transcription)

    @cached_property
    def _nlp_run(self) -> NlpRun:
        """Kept, since it keeps the elastic problem of the feasibility restoration."""
        return NlpRun(
            transcription=self.transcription,
            nlp=self.nlp,
            accuracy=self.solver.accuracy,
            state_error=weak_method(self._integration_error),
            feasibility_restoration=self.solver.feasibility_restoration,
        )

    @cached_property
    def _without_slope(self) -> Transcription:
        """For a fixed start at which a slope is not finite: nothing is differentiated there."""
        return replace(self.transcription, start_as_data=True, compiled=False)

    @cached_property
    def _nlp_run_without_slope(self) -> NlpRun:
        backend = self.solver.nlp_backend
        if backend.name == "native":  # its stages know no start that is data
            backend = replace(backend, name="ipopt")
        nlp = backend.build(self._without_slope)
        return replace(self._nlp_run, transcription=self._without_slope, nlp=nlp)

    # -- real-time iterations ----------------------------------------------------------------

    @property
    def no_feedback(self) -> str:
        """Why it cannot: another backend, a final time or a part of the start that is unknown."""
        if self.solver.backend != "native":
            return "the backend is not the native one; take MultipleShooting(backend='native')"
        names = self.ocp.model.x_names
        free = [f"'{name}'" for name, on in zip(names, self.ocp.start_is_free, strict=True) if on]
        if self.ocp.has_free_time:
            free.append("the final time")
        return f"a start that is measured does not give {', '.join(free)}" if free else ""

    def _freeze(self, data: RunData, guess: InitialGuess | None) -> bool:
        """Freeze the program at the answer of a warm run, or where that will not do of all phases.

        A plan that is optimal already moves no control: the phases tell a minimum from a saddle.
        """
        if not (self._warm_run and guess):
            return False
        if self._warm_run.freeze(data, guess):
            return True
        found = self._solution(data, self._solve(data, guess), 0.0)
        is_minimum = found.status is Status.SOLVED
        return is_minimum and self._warm_run.freeze(data, found, is_minimum=True)

    def _fed_back(self, data: RunData) -> RunResult | None:
        return self._warm_run.fed_back(data) if self._warm_run else None

    @property
    def seconds_in_c(self) -> float | None:
        """What the native backend's last run took, by its own clock [s]; None of other backends."""
        return self.nlp.run.library.report().seconds if isinstance(self.nlp, NativeNlp) else None

    # -- the first iterate -------------------------------------------------------------------

    def first_iterate(
        self, data: RunData, guess: InitialGuess | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return states and controls of the guess, a free final time with the states."""
        return self._iterate(data, guess, first_duration(self.ocp, guess), "tame")

    def _iterate(
        self, data: RunData, guess: InitialGuess | None, duration: float, source: FirstStates
    ) -> tuple[np.ndarray, np.ndarray]:
        x, u = self.grid.first_iterate(data, guess, duration, source)
        blocks = self.transcription.blocks
        u = u if blocks is None else blocks.holding(u)
        return self.transcription.with_time(x, duration), u

    def _warm_start(self, guess: InitialGuess | None) -> WarmStart | None:
        """Return the costates of a guess with states, for a backend that uses them."""
        nx, start = self.ocp.model.nx, np.zeros(1)
        if self.solver.backend != "native" or guess is None:
            return None
        costate = guess.sample("costate", self.grid.fractions, nx)
        if costate is None or guess.sample("x", start, nx) is None:
            return None
        return WarmStart(costate)

    @cached_property
    def _warm_run(self) -> WarmRun | None:
        """Runs from an earlier plan, for the native backend; None: all are ``NlpRun``'s."""
        if self.no_feedback or not isinstance(self.nlp, NativeNlp):
            return None
        return WarmRun(self.nlp.run, self.solver.accuracy)

    # -- the result ---------------------------------------------------------------------------

    def _integration_error(self, result: NlpResult, data: RunData) -> tuple[float, int]:
        """By how much half the step moves the end of an interval, relative to 1 + abs(x)."""
        tr = self.transcription
        z, u = tr.split(result.w)
        schedule = self.grid.schedule(data, tr.duration(result.w))
        return self.grid.error(z[:, : tr.ocp.model.nx], u, schedule)

    def _result(self, data: RunData, outcome: NlpOutcome, tr: Transcription) -> RunResult:
        """The last result, with the work of all runs."""
        result = outcome.last
        z, u = tr.split(result.w)
        if tr.blocks is not None:  # without the rounding of its equations
            u = tr.blocks.holding(u)
        return RunResult(
            status=outcome.status,
            message=outcome.message,
            t=self._nlp_run.times(result, data),
            x=z[:, : tr.ocp.model.nx],
            costate=tr.costates(result.w, result.lam_x, result.lam_g, data),
            u=u,
            cost=result.cost,
            residual=outcome.residual,
            iterations=outcome.iterations,
            work=outcome.work,
            history=outcome.history(),
        )
