"""One ``run`` for all methods: each computes a ``RunResult``, and a ``Solution`` is made of it."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from threading import Lock
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.interrupts import interruptible
from ocp.expressions.table import has_ends
from ocp.method.judged import judged
from ocp.method.method_solver import MethodSolver
from ocp.problem.end_of_definition import end_of_definition
from ocp.problem.run_data import RunData
from ocp.problem.switches import switches
from ocp.solution.jumps import jumps_along
from ocp.solution.solution import ControlKind, Solution
from ocp.solution.solver import BuiltProgram, InitialGuess
from ocp.solution.status import Status
from ocp.solution.work import Work


@dataclass(frozen=True, eq=False, kw_only=True)
class RunResult:
    """What a method knows at the end of a run. Every field means what it means in ``Solution``."""

    status: Status
    message: str = ""
    t: np.ndarray
    x: np.ndarray
    costate: np.ndarray
    u: np.ndarray
    control_kind: ControlKind = "held"
    breaks: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    cost: float
    residual: float = 0.0
    iterations: int = 0
    work: Work = field(default_factory=Work)
    history: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class MethodProgram(BuiltProgram):
    """A program that solves by itself; one that runs others derives from ``BuiltProgram``."""

    solver: MethodSolver
    # What a run writes to, memory of compiled code first of all, is one for all runs.
    _lock: Lock = field(default_factory=Lock, init=False, repr=False)

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Solve for these data, see ``Program.run``, and compare a success with the referee."""
        data = RunData.of(self.ocp, x0, t0, parameters)
        first = self._first_guess(guess)
        with self._lock:
            started = perf_counter()
            found = self._begun(data, first)
            result = found if isinstance(found, RunResult) else _finished(found)
            seconds = perf_counter() - started
        solution = self._solution(data, result, seconds)
        if self._is_done(solution):
            return solution
        return self._checked(solution)

    def _solution(self, data: RunData, result: RunResult, seconds: float) -> Solution:
        """Return what a method has found as a solution."""
        return Solution(
            problem=self.ocp,
            solver=self._solver_text,
            status=result.status,
            message=result.message,
            t=result.t,
            x=result.x,
            x0=data.x0,
            costate=result.costate,
            u=result.u,
            control_kind=result.control_kind,
            breaks=result.breaks,
            cost=result.cost,
            residual=result.residual,
            iterations=result.iterations,
            work=result.work,
            history=result.history,
            parameters=data.values.as_dict(),
            solve_time=seconds,
        )

    def _is_done(self, solution: Solution) -> bool:
        """Whether nothing else is to be looked for in a solution."""
        if self.solver.judged or not solution.status.is_success:
            return False
        return not self._differentiates or switches(self.ocp) is None

    @interruptible
    def _checked(self, solution: Solution) -> Solution:
        """Return a solution with what a look at its trajectory adds."""
        if undefined := _undefined(solution):
            return solution.with_(message="; ".join(filter(None, [solution.message, undefined])))
        if self._differentiates and (jumped := _across_a_jump(solution)):
            return jumped
        if not self.solver.judged:
            return solution
        return judged(solution, self.solver.success_accuracy, slack=self.solver.end_slack)

    @property
    def _differentiates(self) -> bool:
        """Whether the method uses derivatives along the trajectory."""
        return True

    def _begun(
        self, data: RunData, guess: InitialGuess | None
    ) -> RunResult | Callable[[], RunResult]:
        """Solve for checked data without CasADi, or return what solves with it; here the latter."""
        return partial(self._solve, data, guess)

    @abstractmethod
    def _solve(self, data: RunData, guess: InitialGuess | None) -> RunResult:
        """Solve for checked data.

        Args:
            data: start, initial time and parameters of the run.
            guess: where to start: what the caller gives, else the guess of the problem.
        """

    def _first_guess(self, given: InitialGuess | None) -> InitialGuess | None:
        """Return where a run starts, checked."""
        return self.ocp.first_guess(given)

    @cached_property
    def _solver_text(self) -> str:
        return repr(self.solver)


@interruptible
def _finished(solve: Callable[[], RunResult]) -> RunResult:
    return solve()


def _undefined(solution: Solution) -> str:
    """Return which function has no value at the end of what a failed run has found, in words."""
    if solution.status.is_success:
        return ""
    ocp, t, p = solution.problem, solution.t, solution.data.values.at(solution.fractions)
    if found := end_of_definition(ocp, t, solution.x, solution.control(t), p):
        return found
    ending = [f"'{f.name()}'" for f in ocp.functions.called if has_ends(f)]
    if solution.status is Status.DIVERGED and ending:  # its iterates went further
        return f"table {ending[0]} has no value beyond its ends; beyond='extend' would have"
    return ""


def _across_a_jump(solution: Solution) -> Solution | None:
    """Return a success that crosses a jump, which derivatives miss, as INACCURATE."""
    jumps = jumps_along(solution) if solution.status.is_success else ()
    if not jumps:
        return None
    return solution.with_(status=Status.INACCURATE, message=str(jumps[0]))
