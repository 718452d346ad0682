"""A solver's program for the trajectory that violates the hard rows of a problem least."""

from ocp.method.rewriting import RewrittenProgram
from ocp.method.with_slacks import WithSlacks
from ocp.problem.elastic import elastic
from ocp.problem.ocp import OCP
from ocp.solution.solver import Program, Solver


def least_violating(solver: Solver, ocp: OCP) -> Program | None:
    """Build it with a solver that takes path constraints; None where no row is hard."""
    relaxed = elastic(ocp)
    if relaxed is None:
        return None
    return RewrittenProgram(WithSlacks(relaxed), solver.build(relaxed.problem))
