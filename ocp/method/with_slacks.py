"""A problem with slack controls, and its solutions without them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ocp.method.rewriting import Rewriting, RewrittenGuess
from ocp.problem.algebraic_controls import AlgebraicControls
from ocp.problem.elastic import Elastic
from ocp.problem.epigraph import Epigraph
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess


@dataclass(frozen=True, eq=False)
class WithSlacks(Rewriting):
    """The problem with more controls behind its own; the costs are those of this one.

    Attributes:
        extended: the problem without slacks, and how they follow from a trajectory.
        instead: one row of a part that a guess says nothing of, where that has to be known.
    """

    extended: Epigraph | Elastic | AlgebraicControls
    instead: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def original(self) -> OCP:
        """The problem without slacks."""
        return self.extended.original

    @property
    def problem(self) -> OCP:
        """The problem with them."""
        return self.extended.problem

    def guess(self, given: InitialGuess, data: RunData) -> InitialGuess:
        """Return a guess with the slacks that fit."""
        m = self.original.model

        def with_slacks(part: str, fractions: np.ndarray, values: np.ndarray) -> np.ndarray:
            if part != "u":
                return values
            x = given.sample("x", fractions, m.nx)
            return np.hstack([values, self.extended.slacks(fractions, x, values)])

        return RewrittenGuess(given, with_slacks, m, self.instead)

    def answer(self, found: Solution) -> Solution:
        """Return a solution without slacks."""
        original = self.original
        return found.with_(problem=original, u=found.u[:, : original.model.nu])
