"""Solve a problem without the kinks of its cost, and return a solution of it as it was written."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from numpy.typing import ArrayLike

from ocp.method.method_solver import MethodSolver
from ocp.method.rewriting import RewrittenProgram
from ocp.problem.epigraph import Epigraph
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess, Program
from ocp.solution.status import Status


@dataclass(frozen=True, eq=False)
class EpigraphProgram(Program):
    """The problem without its kinks, or as it is written where its parameters ask for that.

    Attributes:
        solver: the options.
        epigraph: the problem with its kinks and without.
        smooth: solves the one without.
        written: solves the problem as it is written, for parameters that turn a kink upside down;
            None where none can.
    """

    solver: MethodSolver
    epigraph: Epigraph
    smooth: RewrittenProgram
    written: Program | None

    def __reduce__(self) -> tuple[Callable[..., Program], tuple[MethodSolver, OCP]]:
        """Return what builds it again, see ``BuiltProgram``."""
        return _built, (self.solver, self.epigraph.original)

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
        original, written = self.epigraph.original, self.written
        original.first_guess(guess)
        if written is not None:
            values = RunData.of(original, x0, t0, parameters).values
            if not self.epigraph.holds(values, t0):
                return written.run(x0=x0, t0=t0, parameters=parameters, guess=guess)
        answer = self.smooth.run(x0=x0, t0=t0, parameters=parameters, guess=guess)
        # A weight that is negative where nobody looked leaves no lower bound of the cost.
        if written is not None and answer.status is Status.DIVERGED:
            return written.run(x0=x0, t0=t0, parameters=parameters, guess=guess)
        return answer


def _built(solver: MethodSolver, ocp: OCP) -> Program:
    return solver.build(ocp)
