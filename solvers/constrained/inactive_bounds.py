"""A problem without the inequalities that do not act at a solution of it."""

from dataclasses import dataclass, replace

import numpy as np

from ocp import OCP, Box, Constraint, Solution, evaluate
from solvers.constrained.standard_form import StandardForm

# A row acts where its value is this close to its bound, or beyond.
_ACTS = 1e-6


@dataclass(frozen=True, eq=False)
class WithoutInequalities:
    """A problem without state bounds, path and terminal inequalities.

    Attributes:
        ocp: what is left.
        dropped: what was left out, in words.
    """

    ocp: OCP
    dropped: str


def without_inactive(solution: Solution) -> WithoutInequalities | None:
    """Return the problem of a solution without its inequalities; None where one of them acts.

    Args:
        solution: its trajectory is integrated by the referee.
    """
    ocp = solution.problem
    names = [c.name for c in ocp.constraints if _is_inequality(c)]
    words = [f"'{name}'" for name in names] + ["state bounds"] * ocp.state_bounds.is_active
    if not words or _acts(solution):
        return None
    left = tuple(c for c in ocp.constraints if not _is_inequality(c))
    return WithoutInequalities(replace(ocp, state_bounds=Box(), constraints=left), ", ".join(words))


def _is_inequality(constraint: Constraint) -> bool:
    return constraint.at in ("path", "terminal") and not constraint.is_equation


def _acts(solution: Solution) -> bool:
    """Whether an inequality holds with equality anywhere, or does not hold."""
    verdict, ocp = evaluate(solution), solution.problem
    along, at_end = StandardForm.along(ocp), StandardForm.at_end(ocp)
    largest = -np.inf
    if along.size:
        found = along.worst_near_nodes(verdict, np.linspace(0.0, 1.0, len(solution.t)))
        largest = found[:, ~along.is_equation].max(initial=-np.inf)
    if at_end.size:
        largest = max(largest, at_end.at_final(verdict)[~at_end.is_equation].max(initial=-np.inf))
    return not largest < -_ACTS
