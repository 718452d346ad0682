"""What of several phases a trajectory violates most at its nodes, in terms of the phase."""

from collections.abc import Iterator

import numpy as np

from ocp.phases.phases_evaluation import link_values, other_violations
from ocp.phases.side_by_side import SideBySide
from ocp.phases.way_back import on_own_clocks
from ocp.problem.constraint_rows import Violation
from ocp.solution.solution import Solution


def most_violated_phase(side: SideBySide, whole: Solution) -> tuple[float, str]:
    """Return the largest violation at the nodes, and the sentence that says so."""
    links = link_values(side, whole, whole.x[-1], whole.x[0])
    found = [
        (amount, f"{what} is violated by {amount:.3g}")
        for amount, what in other_violations(side, whole, links)
    ]
    for phase in on_own_clocks(side, whole):
        worst = max(_at_nodes(phase.normal or phase), key=lambda violation: violation.amount)
        found.append((worst.amount, f"phase '{phase.problem.name}': {worst}"))
    return max(found)


def _at_nodes(solution: Solution) -> Iterator[Violation]:
    """Yield the largest violation of each group of rows at the nodes."""
    ocp, x, t = solution.problem, solution.x, solution.t
    functions, rows, p = ocp.functions, ocp.rows, solution.data.values.at(solution.fractions)
    path = functions.path.map(len(t))(x.T, solution.control(t).T, t[None, :], p.T)
    ends = ((functions.initial, rows.initial, 0), (functions.terminal, rows.terminal, -1))
    yield rows.states.largest_violation(x, t)
    yield rows.path.largest_violation(np.array(path).T, t)
    yield rows.start.largest_violation(x[:1], t[:1])
    for function, group, k in ends:
        yield group.largest_violation(np.array(function(x[k], t[k], p[k])).T, t[[k]])
