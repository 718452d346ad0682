"""What is done to a problem before a method gets it: kinks replaced, everything in sizes."""

from dataclasses import dataclass

from ocp.method.epigraph_program import EpigraphProgram
from ocp.method.in_sizes import InSizes
from ocp.method.method_program import MethodProgram
from ocp.method.method_solver import MethodSolver
from ocp.method.rewriting import RewrittenProgram
from ocp.method.with_slacks import WithSlacks
from ocp.problem.epigraph import Epigraph
from ocp.problem.ocp import OCP
from ocp.problem.scaled import scaled
from ocp.solution.solver import Program


@dataclass(frozen=True)
class ScalingSolver(MethodSolver):
    """A solver that iterates on numbers, and so measures a problem in sizes of its own.

    Every tolerance and residual is relative to those sizes, see ``Solution.sizes``.
    """

    def build_normal(self, ocp: OCP) -> Program:
        """Do all symbolic work; kinks in the cost are replaced first, where that is exact."""
        smooth = self.smooth_form(ocp)
        if smooth is None:
            return self._build_in_sizes(ocp)
        written = self._build_in_sizes(ocp) if smooth.depends_on_data else None
        program = self.unjudged()._build_in_sizes(smooth.problem)
        return EpigraphProgram(self, smooth, self.judging(WithSlacks(smooth), program), written)

    def smooth_form(self, ocp: OCP) -> Epigraph | None:
        """Return the problem with slack controls where this method treats them exactly, or None.

        Here None: a method that takes no path constraints solves the problem as it is written.
        """
        return None

    def _build_in_sizes(self, ocp: OCP) -> Program:
        """Do all symbolic work; a problem that is badly scaled is scaled first."""
        in_sizes = scaled(ocp)
        if in_sizes is None:
            return self.prepare(ocp)
        program = self.unjudged().prepare(in_sizes)
        if not isinstance(program, MethodProgram):  # it runs others, and judges by itself
            return RewrittenProgram(InSizes(in_sizes), program)
        return self.judging(InSizes(in_sizes), program)
