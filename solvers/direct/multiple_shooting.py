"""Direct multiple shooting: the problem on a grid, solved by an interior-point method."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, RK4, InitialGuess, Integrator, Program, Solution, Solver
from ocp.internal import RunData, Transcription, check_instance, check_positive, check_whole
from solvers.direct.nlp_backends import NlpBackend, NlpResult
from solvers.direct.nlp_run import NlpOutcome, NlpRun
from solvers.direct.shooting_grid import ShootingGrid


@dataclass(frozen=True)
class MultipleShooting(Solver):
    """The direct baseline: everything that a problem can say.

    Source: [Bock & Plitt 1984]; backends [Waechter & Biegler 2006], [Vanroye et al. 2023].

    Args:
        intervals: number of intervals, with one held control each; a discrete-time problem
            brings its own number.
        integrator: one-step method in each interval.
        backend: ``"ipopt"``, or ``"fatrop"``, which exploits the stages.
        tolerance: of the optimality conditions.
        max_iterations: limit of the backend.
        accuracy: largest accepted change of a state, relative to 1 + abs(x), when the step of an
            interval is halved; an answer beyond it is ``INACCURATE``.
        verbose: let the backend print.
        compiled: run the stages as machine code; the first build takes seconds, see ``compiled``.
        time_limit: for each run of the backend, of which a solve may take three [s]; inf:
            unlimited; None: unlimited, but 10 s in ``MPC``. IPOPT returns its iterate,
            ``TIME_LIMIT``. fatrop may never return from a problem that cannot be solved; where
            there is a limit it runs in a process of its own, and once ended it has nothing to
            show: ``FAILED``.
        feasibility_restoration: where the search fails, look for the least violating
            trajectory: it tells an infeasible problem from a lost search and is a better start for
            a second one. It may cost 300 iterations; a controller that has to answer in time
            does without.
    """

    intervals: int = 75
    integrator: Integrator = field(default_factory=RK4)
    backend: Literal["ipopt", "fatrop"] = "ipopt"
    tolerance: float = 1e-9
    max_iterations: int = 300
    accuracy: float = 1e-2
    verbose: bool = False
    compiled: bool = False
    time_limit: float | None = None
    feasibility_restoration: bool = True

    def __post_init__(self) -> None:
        """Check the options."""
        check_whole(self.intervals, "multiple shooting: intervals")
        check_instance(self.integrator, Integrator, "multiple shooting: integrator")
        check_positive(self.accuracy, "multiple shooting: accuracy", finite=False)
        self.options  # noqa: B018 - checks its own

    @property
    def options(self) -> NlpBackend:
        """The backend with its options."""
        return NlpBackend(
            name=self.backend,
            tolerance=self.tolerance,
            max_iterations=self.max_iterations,
            verbose=self.verbose,
            time_limit=np.inf if self.time_limit is None else self.time_limit,
        )

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "MultipleShooting":
        """Set what is left open; see ``Solver``."""
        limit = time_limit if self.time_limit is None else self.time_limit
        return replace(self, compiled=compiled or self.compiled, time_limit=limit)

    def build(self, ocp: OCP) -> "MultipleShootingProgram":
        """Transcribe the problem and set the backend up."""
        transcription = Transcription(ocp, self.intervals, self.integrator, self.compiled)
        intervals = ShootingGrid.of(ocp, transcription.n, self.integrator, fast=self.compiled)
        program = MultipleShootingProgram(self, transcription, intervals)
        program.search.nlp  # noqa: B018 - all symbolic work is done here
        return program


@dataclass(frozen=True, eq=False)
class MultipleShootingProgram(Program):
    """A transcribed problem with its backend.

    Attributes:
        solver: the options.
        transcription: the problem on its grid.
        intervals: for first guesses, and to check the integrator.
    """

    solver: MultipleShooting
    transcription: Transcription
    intervals: ShootingGrid

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Solve for these data; where that fails, look for a trajectory that is feasible."""
        started = perf_counter()
        ocp = self.transcription.ocp
        data = RunData.of(ocp, x0, t0, parameters)
        z, u = self.first_iterate(data, ocp.first_guess(guess))
        found = self.search.solve(self.transcription.join(z, u), data)
        return self._solution(data, found, perf_counter() - started)

    @cached_property
    def search(self) -> NlpRun:
        """The backend, and what is done around it."""
        solver = self.solver
        return NlpRun(
            transcription=self.transcription,
            options=solver.options,
            accuracy=solver.accuracy,
            error=self._integration_error,
            feasibility_restoration=solver.feasibility_restoration,
        )

    # -- the first iterate -------------------------------------------------------------------

    def first_iterate(
        self, data: RunData, guess: InitialGuess | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return states and controls of the guess, a free final time with the states."""
        tr, ocp = self.transcription, self.transcription.ocp
        duration = (guess.duration if guess and ocp.has_free_time else None) or ocp.duration
        x, u = self.intervals.first_iterate(data, guess, duration)
        z = np.hstack([x, np.full((tr.n + 1, 1), duration)]) if ocp.has_free_time else x
        return z, u

    # -- the answer ---------------------------------------------------------------------------

    def _integration_error(self, answer: NlpResult, data: RunData) -> tuple[float, int]:
        """By how much half the step moves the end of an interval, relative to 1 + abs(x)."""
        tr = self.transcription
        z, u = tr.split(answer.w)
        schedule = self.intervals.schedule(data, tr.duration(answer.w))
        return self.intervals.error(z[:, : tr.ocp.model.nx], u, schedule)

    def _solution(self, data: RunData, found: NlpOutcome, seconds: float) -> Solution:
        """The last answer, with the work of all."""
        tr, answer = self.transcription, found.last
        z, u = tr.split(answer.w)
        return Solution(
            problem=tr.ocp,
            solver=repr(self.solver),
            status=found.status,
            message=found.message,
            t=self.search.times(answer, data),
            x=z[:, : tr.ocp.model.nx],
            x0=data.x0,
            costate=tr.costates(answer.w, answer.lam_x, answer.lam_g, data),
            u=u,
            cost=answer.cost,
            residual=found.residual,
            iterations=found.iterations,
            work=found.work,
            history=found.history(),
            parameters=data.values.as_dict(),
            solve_time=seconds,
        )
