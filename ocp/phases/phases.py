"""Several problems one after another, as a user writes them."""

from dataclasses import dataclass, replace
from typing import Any

from ocp.checks.arguments import check_instance
from ocp.checks.errors import UnsupportedProblem
from ocp.method.blocking_solver import BlockingSolver
from ocp.method.method_solver import MethodSolver
from ocp.phases.chain import Chain
from ocp.phases.describe_phases import describe_phases
from ocp.phases.phases_guess import PhasesGuess, checked_guess
from ocp.phases.phases_program import PhasesProgram
from ocp.phases.phases_solution import PhasesSolution
from ocp.phases.side_by_side import side_by_side
from ocp.solution.composite import CompositeProblem
from ocp.solution.solver import Solver


@dataclass(frozen=True, eq=False, repr=False)
class Phases(Chain, CompositeProblem[PhasesSolution]):
    r"""Problems one after another: the start of each follows from the end of the one before.

    .. math::

        \min \sum_i J_i \quad \text{s.t.} \quad x_{i+1}(t_i) = r_i(x_i(t_i)), \quad
        t_i = t_0 + T_1 + \dots + T_i

    A phase is a whole ``OCP``, which can be tested alone: with a model, costs, constraints and a
    duration of its own, fixed or ``FreeTime``. Its time goes on from the phase before; its signals
    run over the phase. Of a phase that a link leads to, ``x0`` is a guess where the link decides.

    Every phase gets the intervals of the solver. Phases that are alike, with free durations and
    nothing that happens between them, have no unique solution: time can be shifted from one to the
    other.

    Args:
        name: what people call it.
        phases: two or more, in their order, of different names.
        links: one from each phase to the next, and for a cycle one from the last to the first;
            empty: states go on by their names, see ``Link``.
        total: the sum of all durations [s], a number or a ``Box``; None: nothing couples them.
        unknowns: constants of all phases that the optimiser chooses; a phase has each as a
            ``Parameter`` of the same symbol.

    Raises:
        ProblemError: naming the phase, the link or the time that does not fit.
    """

    def describe(self) -> str:
        """Return phases and links in mathematics, for a person."""
        return describe_phases(self)

    def first_guess(self, given: Any = None) -> PhasesGuess | None:
        """Return where a run starts, checked."""
        return checked_guess(self, given)

    def built_by(self, solver: Solver) -> PhasesProgram:
        """Let a solver do all symbolic work.

        Raises:
            UnsupportedProblem: if it takes no phases, or not a term of them.
        """
        check_instance(solver, Solver, f"{self.name}: the solver")
        if not (solver.takes_phases and isinstance(solver, MethodSolver)):
            raise UnsupportedProblem(
                f"{self.name}: {type(solver).__name__} takes no phases, whose starts and ends are "
                "coupled; MultipleShooting, Collocation and IndirectShooting do"
            )
        side = side_by_side(self)
        unjudged = solver.unjudged()
        if isinstance(unjudged, BlockingSolver):
            unjudged = replace(unjudged, blocked=side.own_controls)
        program = unjudged.build(side.problem)
        accuracy = solver.success_accuracy if solver.judged else float("inf")
        return PhasesProgram(side, program, accuracy, solver.end_slack)
