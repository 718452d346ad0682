"""Solve a problem in sizes of its own, and return the solution in the units of the user."""

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ocp.method.judged import judged
from ocp.method.method_program import MethodProgram
from ocp.method.method_solver import MethodSolver
from ocp.problem.nominal_sizes import Sizes
from ocp.problem.run_data import RunData
from ocp.problem.scaled import ScaledOCP
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess, Program


@dataclass(frozen=True, eq=False)
class ScaledProgram(Program):
    """A program of the scaled problem, asked and answering in the user's units.

    Attributes:
        ocp: the scaled problem.
        program: solves it, and compares nothing with the referee, unless it does by itself.
        solver: the options.
    """

    ocp: ScaledOCP
    program: Program
    solver: MethodSolver

    @property
    def is_stateful(self) -> bool:
        """Whether an answer depends on the runs before it."""
        return self.program.is_stateful

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Solve for these data, see ``Program.run``."""
        started, original, sizes = perf_counter(), self.ocp.original, self.ocp.sizes
        data = RunData.of(original, x0, t0, parameters)
        given = original.first_guess(guess)
        solution = self.program.run(
            x0=data.x0 / sizes.x,
            t0=t0,
            parameters=parameters,
            guess=None if given is None else _ScaledGuess(given, sizes),
        )
        answer = in_original_units(solution, self.ocp)
        answer = answer.with_(x0=data.x0, solve_time=perf_counter() - started)
        # In the units of the user, as every number in a message is.
        if not self.solver.judged or not isinstance(self.program, MethodProgram):
            return answer
        return judged(answer, self.solver.success_accuracy, slack=self.solver.end_slack)


def in_original_units(solution: Solution, ocp: ScaledOCP) -> Solution:
    """Return a solution of a scaled problem as one of the original."""
    sizes = ocp.sizes
    history = {
        name: values * sizes.cost if name == "cost" else values
        for name, values in solution.history.items()
    }
    return solution.with_(
        problem=ocp.original,
        x=solution.x * sizes.x,
        x0=solution.x0 * sizes.x,
        u=solution.u * sizes.u,
        costate=solution.costate * (sizes.cost / sizes.x),
        cost=solution.cost * sizes.cost,
        history=history,
    )


def in_own_units(solution: Solution, ocp: ScaledOCP) -> Solution:
    """Return a solution of the original problem as one of the scaled problem."""
    sizes = ocp.sizes
    return solution.with_(
        problem=ocp,
        x=solution.x / sizes.x,
        x0=solution.x0 / sizes.x,
        u=solution.u / sizes.u,
        costate=solution.costate * (sizes.x / sizes.cost),
        cost=solution.cost / sizes.cost,
    )


@dataclass(frozen=True, eq=False)
class _ScaledGuess:
    """A guess in the user's units, sampled in sizes."""

    guess: InitialGuess
    sizes: Sizes

    @property
    def duration(self) -> float | None:
        return self.guess.duration

    def sample(self, part: str, fractions: np.ndarray, width: int) -> np.ndarray | None:
        values = self.guess.sample(part, fractions, width)
        if values is None:
            return None
        x, u, cost = self.sizes.x, self.sizes.u, self.sizes.cost
        return values / {"x": x, "u": u, "costate": cost / x}[part]
