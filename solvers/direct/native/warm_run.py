"""``WarmRun``: a run from an earlier plan, with first iterate and checks of the answer in C.

In a control loop nearly every run is one of these. What it does is what ``NlpRun`` does for a warm
start whose answer needs nothing else; of any other answer ``NlpRun`` takes over.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter

import numpy as np

from ocp import OCP, InitialGuess, Status, Work
from ocp.internal import (
    RunData,
    RunResult,
    ShiftedPlan,
    Transcription,
    interruptible,
    start_violation,
)
from solvers.direct.native.native_arrays import NativeArrays
from solvers.direct.native.native_library import (
    NativeAccount,
    NativeOptions,
    NativeReport,
)
from solvers.direct.native.native_solve import ENDINGS, NativeSolve
from solvers.direct.nlp_verdict import NOT_STATIONARY, VIOLATED
from solvers.direct.warm_start import WarmStart

_SOLVED = ENDINGS.index("solved")
# A cost that differs from the quadratic one by more than this share is not what was minimised.
_BENT = 0.02
_FED_BACK = "one real-time iteration, from the plan for the state that was expected"


@dataclass(frozen=True, eq=False)
class WarmRun:
    """Runs of one problem whose start and final time are given.

    Attributes:
        solver: the native solver of the problem.
        accuracy: the largest accepted error of a state, see ``NlpVerdict``.
    """

    solver: NativeSolve
    accuracy: float

    def __call__(self, data: RunData, guess: InitialGuess) -> RunResult | WarmStart | None:
        """Run from a guess.

        Returns:
            the answer; where it is not optimal, not accurate, or some control did not move, how the
            run has ended; None where nothing was run: the guess has no states or costates.
        """
        started, library = perf_counter(), self.solver.library
        ending = self._ended(data, guess)
        if ending == _SOLVED:
            account, report = library.account(), library.report()
            is_clean = self._is_right(account, report) and account.unmoved == 0.0
            if is_clean and not self._start_violation(self._ocp, data):
                return self._result(data, report)
        return None if ending is None else WarmStart(None, ending, perf_counter() - started)

    def freeze(self, data: RunData, guess: InitialGuess, *, is_minimum: bool = False) -> bool:
        """Run from a guess, and freeze the program at the answer; return whether there is one.

        Args:
            data: of the run.
            guess: has states and costates.
            is_minimum: whether it is known to be one. Where it is not, an answer of which some
                control did not move may be a saddle, and is none.
        """
        library = self.solver.library
        if self._ended(data, guess) != _SOLVED:
            return False
        account = library.account()
        if not self._is_right(account, library.report()):
            return False
        if account.unmoved > 0.0 and not is_minimum:
            return False
        library.freeze()
        return True

    def fed_back(self, data: RunData) -> RunResult | None:
        """Return the answer of the program that was frozen last for another start; None: none.

        The states are those of the frozen program, whose dynamics are linear; cost and residual are
        those of the problem itself there. Where its cost is not the one that the frozen program
        said, that has no answer.
        """
        library = self.solver.library
        self._arrays.x[0] = data.x0
        library.begin()
        if all(library.solve(options) != _SOLVED for options in self._frozen_options):
            return None
        library.account()
        said = library.report().cost
        library.judge()
        report = library.report()
        if abs(report.cost - said) > _BENT * abs(report.cost) + self.solver.limits.tolerance:
            return None
        return replace(self._result(data, report), status=Status.ITERATION_LIMIT, message=_FED_BACK)

    def _ended(self, data: RunData, guess: InitialGuess) -> int | None:
        """Solve from a guess; return how that has ended, None where it has no first iterate."""
        at, library = self._arrays, self.solver.library
        self.solver.put_data(data)
        if not self._begin(guess):
            return None
        at.x[0] = data.x0
        at.u[self._given] = self._given_controls
        library.begin()
        return library.solve(self._options)

    def _begin(self, guess: InitialGuess) -> bool:
        """Write the first iterate; return whether the guess has one."""
        at, tr, earlier = self._arrays, self._transcription, ShiftedPlan.of(guess)
        if earlier is not None and self._fits(earlier):
            plan = earlier.plan
            at.plan_t[:], at.plan_x[:], at.plan_u[:] = plan.t, plan.x, plan.u
            at.plan_costate[:] = plan.costate
            self.solver.library.shift(earlier.t0, plan.duration)
            return True
        m, nodes = self._ocp.model, tr.fractions
        x, costate = (guess.sample(part, nodes, m.nx) for part in ("x", "costate"))
        u = guess.sample("u", nodes[:-1], m.nu)
        if x is None or costate is None or u is None:
            return False
        at.x[:], at.u[:], at.costate[:] = x, u, costate
        return True

    def _fits(self, earlier: ShiftedPlan) -> bool:
        """Whether the library can read a plan off: it has as many nodes and numbers."""
        plan, at = earlier.plan, self._arrays
        shapes = plan.t.shape, plan.x.shape, plan.u.shape
        own = at.plan_t.shape, at.plan_x.shape, at.plan_u.shape
        return plan.control_kind == "held" and shapes == own

    def _is_right(self, account: NativeAccount, report: NativeReport) -> bool:
        """Whether an answer is optimal and accurate; NaN is not."""
        is_optimal = report.dual <= NOT_STATIONARY * (1.0 + report.multiplier)
        is_accurate = self._ocp.model.is_discrete or account.moved <= self.accuracy
        return is_optimal and is_accurate and report.primal <= VIOLATED

    def _result(self, data: RunData, report: NativeReport) -> RunResult:
        at, notes = self._arrays, self.solver.library.notes()
        evaluations = int(report.evaluations)
        return RunResult(
            status=Status.SOLVED,
            t=data.t0 + self._since_start,
            x=at.x.copy(),
            costate=at.costate.copy(),
            u=at.u.copy(),
            cost=report.cost,
            residual=report.dual,
            iterations=int(report.iterations),
            work=Work(int(report.values) + evaluations, evaluations, int(report.factorisations)),
            history={"cost": notes[:, 0], "infeasibility": notes[:, 1], "residual": notes[:, 2]},
        )

    @cached_property
    def _transcription(self) -> Transcription:
        return self.solver.library.code.transcription

    @cached_property
    def _ocp(self) -> OCP:
        return self._transcription.ocp

    @cached_property
    def _start_violation(self) -> Callable[[OCP, RunData], str]:
        """Rows of the start alone are called by CasADi, which forgets Ctrl-C."""
        has_rows = bool(self._ocp.decided_by_start.any())
        return interruptible(start_violation) if has_rows else start_violation

    @cached_property
    def _since_start(self) -> np.ndarray:
        """Instants of the nodes after the start [s], (N + 1,)."""
        return self._transcription.fractions * self._ocp.duration

    @cached_property
    def _arrays(self) -> NativeArrays:
        """The arrays of the library, with bounds that are those of every run."""
        data = RunData.of(self._ocp)
        self.solver.put_bounds(self._transcription.bounds(data))
        return self.solver.library.arrays

    @cached_property
    def _given(self) -> np.ndarray:
        """Which controls have equal bounds, bool (N, nu)."""
        return self._arrays.u_given != 0.0

    @cached_property
    def _given_controls(self) -> np.ndarray:
        bounds = self._transcription.bounds(RunData.of(self._ocp))
        return self._transcription.split(bounds["lbx"])[1][self._given]

    @cached_property
    def _options(self) -> NativeOptions:
        return self.solver.warm_options

    @cached_property
    def _frozen_options(self) -> tuple[NativeOptions, ...]:
        return self.solver.limits.of_frozen
