"""A problem in sizes of its own, and its solutions in the units of the user."""

from dataclasses import dataclass

import numpy as np

from ocp.method.rewriting import Rewriting, RewrittenGuess
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData
from ocp.problem.scaled import ScaledOCP
from ocp.solution.shifted_plan import ShiftedPlan
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess


@dataclass(frozen=True, eq=False)
class InSizes(Rewriting):
    """The scaled problem.

    Attributes:
        scaled: in sizes of its own.
    """

    scaled: ScaledOCP

    @property
    def problem(self) -> OCP:
        """The problem in sizes."""
        return self.scaled

    @property
    def original(self) -> OCP:
        """The problem in the units of the user."""
        return self.scaled.original

    def start(self, data: RunData) -> np.ndarray:
        """Return the start in sizes."""
        return data.x0 / self.scaled.sizes.x

    def guess(self, given: InitialGuess, data: RunData) -> InitialGuess:
        """Return a guess that is sampled in sizes; an earlier plan stays one."""
        earlier, sizes = ShiftedPlan.of(given), self.scaled.sizes
        if earlier is not None and self._is_held_here(earlier.plan):
            plan = self.written(earlier.plan)
            return plan if given is earlier.plan else ShiftedPlan(plan, earlier.t0)
        size = {"x": sizes.x, "u": sizes.u, "costate": sizes.cost / sizes.x}
        return RewrittenGuess(
            given, lambda part, _, values: values / size[part], self.original.model
        )

    def _is_held_here(self, plan: Solution) -> bool:
        """Whether a plan has held controls, and the numbers of states and controls of this one."""
        m = self.original.model
        fits = (plan.x.shape[1], plan.u.shape[1]) == (m.nx, m.nu)
        return fits and plan.control_kind == "held"

    def answer(self, found: Solution) -> Solution:
        """Return a solution of the scaled problem as one of the original."""
        sizes = self.scaled.sizes
        history = {
            name: values * sizes.cost if name == "cost" else values
            for name, values in found.history.items()
        }
        return found.with_(
            problem=self.original,
            x=found.x * sizes.x,
            x0=found.x0 * sizes.x,
            u=found.u * sizes.u,
            costate=found.costate * (sizes.cost / sizes.x),
            cost=found.cost * sizes.cost,
            history=history,
        )

    def written(self, solution: Solution) -> Solution:
        """Return a solution of the original as one of the scaled problem."""
        sizes = self.scaled.sizes
        return solution.with_(
            problem=self.problem,
            x=solution.x / sizes.x,
            x0=solution.x0 / sizes.x,
            u=solution.u / sizes.u,
            costate=solution.costate * (sizes.x / sizes.cost),
            cost=solution.cost / sizes.cost,
        )
