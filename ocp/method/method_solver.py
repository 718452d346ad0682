"""What the solvers of all methods have in common: a success is compared with the referee."""

from abc import abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self, overload

import numpy as np

from ocp.checks.arguments import check_flag, check_instance
from ocp.checks.interrupts import interruptible
from ocp.method.in_normal_form import InNormalForm
from ocp.method.rewriting import Rewriting, RewrittenProgram
from ocp.normal_form.normal_form import NormalForm, normal_form
from ocp.problem.grid import Grid
from ocp.problem.node_fractions import node_fractions
from ocp.problem.ocp import OCP
from ocp.problem.refusal import refuse_without_derivatives
from ocp.solution.composite import CompositeProblem, CompositeProgram, S
from ocp.solution.solver import Program, Solver

#: By how much own cost and the referee's may differ, relative, where a solver has no option.
ACCURACY = 1e-2


@dataclass(frozen=True)
class MethodSolver(Solver):
    """A solver whose program is a ``MethodProgram``.

    Attributes:
        judged: whether a success is compared with the referee, see ``judged``. A control loop
            and methods that do it by themselves switch it off.
        derivatives: how often the method differentiates a problem.
        takes_knots: whether knots of signals are nodes of the grid, see ``node_fractions``. A
            control loop, which reads held controls at its own instants, switches it off.
    """

    derivatives: ClassVar[int] = 2
    judged: bool = field(default=True, kw_only=True, repr=False, compare=False)
    takes_knots: bool = field(default=True, kw_only=True, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the option."""
        check_flag(self.judged, f"{type(self).__name__}: judged")
        check_flag(self.takes_knots, f"{type(self).__name__}: takes_knots")

    @overload
    def build(self, ocp: OCP) -> Program: ...

    @overload
    def build(self, ocp: CompositeProblem[S]) -> CompositeProgram[S]: ...

    @interruptible
    def build(self, ocp: OCP | CompositeProblem[S]) -> Program | CompositeProgram[S]:
        """Do all symbolic work for a problem, after it is brought into its normal form.

        Raises:
            UnsupportedProblem: naming the term that this method cannot treat.
        """
        if isinstance(ocp, CompositeProblem):
            return ocp.built_by(self)
        check_instance(ocp, OCP, f"{type(self).__name__}: the problem")
        return self.build_one(ocp)

    def build_one(self, ocp: OCP) -> Program:
        """Build a single problem; see ``build``."""
        self.refuse_written(ocp)
        refuse_without_derivatives(ocp, self.derivatives, type(self).__name__)
        form = normal_form(ocp)
        if form is None:
            return self.build_normal(ocp)
        return self.judging(InNormalForm(form), self.unjudged().build_form(form))

    def build_form(self, form: NormalForm) -> Program:
        """Build it for a problem in its normal form; here with algebraic variables solved for."""
        return self.build_normal(form.problem)

    def refuse_written(self, ocp: OCP) -> None:
        """Refuse what only a problem as it was written shows; here nothing.

        Raises:
            UnsupportedProblem: naming the term.
        """

    def build_normal(self, ocp: OCP) -> Program:
        """Build it for a problem in normal form; here in the units it is written in."""
        return self.prepare(ocp)

    @abstractmethod
    def prepare(self, ocp: OCP) -> Program:
        """Do all symbolic work for a problem in normal form, in the units it is written in."""

    @property
    def success_accuracy(self) -> float:
        """The accepted relative error of a success; inf: none is looked for."""
        return ACCURACY

    @property
    def end_slack(self) -> float:
        """By how much a terminal constraint may be missed in any case, in its own unit."""
        return 0.0

    def nodes(self, ocp: OCP, intervals: int | Grid) -> np.ndarray:
        """Return the nodes of a grid as fractions of the horizon, (N + 1,)."""
        if not (self.takes_knots or isinstance(intervals, Grid)):
            return np.linspace(0.0, 1.0, (ocp.steps or intervals) + 1)
        return node_fractions(ocp, intervals)

    def judging(self, rewriting: Rewriting, program: Program) -> RewrittenProgram:
        """Return a program around one of a rewritten problem, which itself judges nothing."""
        accuracy = self.success_accuracy if self.judged else np.inf
        return RewrittenProgram(rewriting, program, accuracy, self.end_slack)

    def unjudged(self) -> Self:
        """Return the solver without the comparison."""
        return replace(self, judged=False)

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> Solver:
        """Compare nothing: a step has no time for it; see ``Solver``."""
        return replace(self, judged=False, takes_knots=False)
