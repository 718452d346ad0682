"""``switched``: the best switching on a grid, between a lower and an upper bound."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, Evaluation, Solution, UnsupportedProblem, evaluate, solve
from ocp.internal import check_instance
from solvers.direct.multiple_shooting import MultipleShooting
from solvers.switching.convexified import Convexified
from solvers.switching.modes import Modes
from solvers.switching.sum_up_rounding import deviation, sum_up_rounding

# The rounded controls count as an answer where they violate less than this, between nodes too.
_VIOLATION = 1e-4


@dataclass(frozen=True, eq=False)
class SwitchedSolution:
    r"""A switching, and what is known of a better one.

    Attributes:
        solution: of the problem as it was written: controls with levels take one in each interval.
        relaxed: of the relaxed problem, in the shares of the modes.
        modes: values of the controls with levels in each mode, (M, m).
        chosen: the mode of each interval, int (N,).
        shares: those that the relaxed problem wants, (N, M).
        deviation: the largest difference of their integrals over time [s]; in discrete time of
            their sums [s].
        bound: what sum-up rounding keeps it below, (M - 1) times the widest interval [s].
        violation: accepted for the upper bound.
    """

    solution: Solution
    relaxed: Solution
    modes: np.ndarray
    chosen: np.ndarray
    shares: np.ndarray
    deviation: float
    bound: float
    violation: float = _VIOLATION

    @cached_property
    def evaluation(self) -> Evaluation:
        """The referee's verdict on the switching."""
        return evaluate(self.solution)

    @cached_property
    def lower(self) -> float:
        """The referee's cost of the relaxed optimum: no switching on this grid costs less.

        As far as that optimum is the global one; -inf where the relaxed problem was not solved.
        """
        if not self.relaxed.status.is_success:
            return -np.inf
        return evaluate(self.relaxed).cost

    @property
    def upper(self) -> float:
        """The referee's cost of the switching; inf where it violates a constraint."""
        return self.evaluation.cost if self.evaluation.violation <= self.violation else np.inf

    @property
    def gap(self) -> float:
        """By how much the best switching on this grid may be better, upper - lower."""
        return self.upper - self.lower

    @property
    def switches(self) -> int:
        """How often the mode changes."""
        return int((np.diff(self.chosen) != 0).sum())

    def __str__(self) -> str:
        """Return what is known, in a few sentences."""
        name, n = self.solution.problem.name, len(self.chosen)
        said = (
            f"{name}: {self.switches} switches on {n} intervals cost {self.evaluation.cost:.7g}. "
        )
        if not self.relaxed.status.is_success:
            why = f"{self.relaxed.status.value}. {self.relaxed.message}".strip()
            return (
                f"{said}How good they are is not known, the relaxed problem was not solved: {why}"
            )
        if self.upper == np.inf:
            said += (
                f"They violate {self.evaluation.worst}: what the relaxed problem meets a switching "
                "meets only nearly; take more intervals, or a soft constraint. "
            )
        said += f"No switching on this grid costs less than {self.lower:.7g}. "
        return said + f"The integrals differ by {self.deviation:.3g} s, at most {self.bound:.3g} s."


def switched(
    ocp: OCP, levels: Mapping[str, ArrayLike], solver: MultipleShooting
) -> SwitchedSolution:
    r"""Solve a problem some of whose controls take only listed values: valves, gears, switches.

    Relaxed by the shares of the modes, which are all choices of levels (partial outer
    convexification [Sager 2009]), then rounded so that the integrals of the shares stay near
    (sum-up rounding [Sager, Bock & Diehl 2012]), then solved once more for the controls that have
    no levels. What is lost is bounded by a constant times the widest interval, so it vanishes with
    narrow ones, though not in every step; how much it is here lies between ``lower`` and ``upper``.

    Args:
        ocp: the problem; constraints with such a control are on it alone (which levels go
            together), or integrals.
        levels: the values of each such control by its name, two or more, within its bounds.
        solver: its intervals are those between which a control may switch.

    Returns:
        the switching, both bounds, and how far sums of it are from those of the relaxed problem.
        Where a solve fails, its status says so.

    Raises:
        ProblemError: naming the control and what is wrong with its values.
        UnsupportedProblem: naming a term that mixes levels with something else, or a ``Rate`` in
            continuous time.
    """
    check_instance(ocp, OCP, "switched: the problem")
    check_instance(solver, MultipleShooting, f"{ocp.name}: the solver of a switched problem")
    if solver.blocks:
        raise UnsupportedProblem(
            f"{ocp.name}: switched, with blocks: controls are rounded in each interval; give a "
            "Grid with wider intervals instead"
        )
    form = Convexified(ocp, Modes.of(ocp, levels))
    relaxed = solve(form.relaxed(), solver)
    shares, widths = form.shares(relaxed.u), np.diff(relaxed.t)
    chosen = sum_up_rounding(shares, widths)
    rest = solve(form.fixed(chosen, relaxed.fractions, relaxed.x), solver)
    solution = rest.with_(problem=ocp, u=form.controls(chosen, rest.u), normal=None)
    return SwitchedSolution(
        solution=solution,
        relaxed=relaxed,
        modes=form.modes.values,
        chosen=chosen,
        shares=shares,
        deviation=deviation(shares, chosen, widths),
        bound=(form.modes.count - 1) * float(widths.max()),
    )
