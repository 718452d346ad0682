"""Solve a problem without the kinks of its cost, and return a solution of it as it was written."""

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ocp.method.judged import judged
from ocp.method.method_solver import MethodSolver
from ocp.problem.epigraph import Epigraph
from ocp.problem.run_data import RunData
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess, Program


@dataclass(frozen=True, eq=False)
class EpigraphProgram(Program):
    """A program with slack controls, asked and answering without them.

    Attributes:
        solver: the options.
        epigraph: the problem with its kinks and without.
        smooth: solves the one without; compares nothing with the referee.
        written: solves the problem as it is written, for parameters that turn a kink upside down;
            None where none can.
    """

    solver: MethodSolver
    epigraph: Epigraph
    smooth: Program
    written: Program | None

    @property
    def is_stateful(self) -> bool:
        """Whether an answer depends on the runs before it."""
        return self.smooth.is_stateful

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Solve for these data, see ``Program.run``."""
        original = self.epigraph.original
        data, given = RunData.of(original, x0, t0, parameters), original.first_guess(guess)
        if self.written and not self.epigraph.holds(data.values):
            return self.written.run(x0=x0, t0=t0, parameters=parameters, guess=guess)
        started = perf_counter()
        solution = self.smooth.run(
            x0=x0,
            t0=t0,
            parameters=parameters,
            guess=None if guess is None else _GuessWithSlacks(given, self.epigraph),
        )
        nu, seconds = original.model.nu, perf_counter() - started
        answer = solution.with_(problem=original, u=solution.u[:, :nu], solve_time=seconds)
        if not self.solver.judged:
            return answer
        return judged(answer, self.solver.success_accuracy, slack=self.solver.end_slack)


@dataclass(frozen=True, eq=False)
class _GuessWithSlacks:
    """A guess of the original problem, sampled with slacks that touch their maxima."""

    guess: InitialGuess
    epigraph: Epigraph

    @property
    def duration(self) -> float | None:
        return self.guess.duration

    def sample(self, part: str, fractions: np.ndarray, width: int) -> np.ndarray | None:
        m = self.epigraph.original.model
        if part != "u":
            return self.guess.sample(part, fractions, width)
        u = self.guess.sample("u", fractions, m.nu)
        if u is None:
            return None
        x = self.guess.sample("x", fractions, m.nx)
        return np.hstack([u, self.epigraph.slacks(fractions, x, u)])
