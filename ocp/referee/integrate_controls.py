"""Integrate a solution's controls by the method that suits them, until cost and end hold still."""

from dataclasses import replace

import numpy as np

from ocp.referee.reference_trajectory import ReferenceTrajectory, Replayed
from ocp.referee.refinement import ROUNDING, end_moved, is_resolved, refined
from ocp.referee.segments import gaps, is_amplified
from ocp.solution.solution import Solution

# CVODES integrates with these tolerances; a multiple of the last difference and a part of the
# largest one bound the error, which falls by less than the tolerance does.
_TOLERANCES = (1e-7, 1e-8, 1e-9)
_OF_LAST, _OF_LARGEST = 2.0, 0.25
# Differences below this part of the last tolerance are chance, and bound nothing.
_CHANCE = 1e-2
# And is looked at this often over the horizon, at least.
_FEWEST_SAMPLES = 400
# A finite trajectory of more intervals is left to explicit steps: CVODES begins anew in each.
_MANY_INTERVALS = 2000
# Of the cost, where only the states are asked for.
_GAP_TOLERANCE = 1e-6


def integrate_controls(solution: Solution, *, tolerance: float = 1e-9) -> ReferenceTrajectory:
    """Integrate a solution's controls from its start, refining until cost and end hold still.

    The steps of RK4 are made shorter until the cost is known to ``tolerance``, relative to its
    size (the integral of abs(L) plus the magnitude of the terminal cost), and the final state
    to a thousand times that: close to a singular configuration it goes on moving long after the
    cost has settled. Where they do not get there, or the state does not stay finite, CVODES is
    tried. Where the dynamics amplify what the solution's own states are off by until nothing
    of them is left, the controls are applied by segments, from each node to the next.

    Args:
        solution: controls of any kind; the start is the one that was asked for, or the
            solution's own where the problem leaves it free.
        tolerance: accepted error of the cost.

    Returns:
        the finest trajectory; not finite if the state blows up or no method resolves it.
    """
    in_open_loop = _best(Replayed(solution), tolerance)
    by_segments = Replayed(solution, "by segments")
    if not is_amplified(in_open_loop, by_segments):
        return in_open_loop
    return _best(by_segments, tolerance)


def segment_gaps(solution: Solution) -> np.ndarray:
    """Return by how much the controls, from node to node, miss the solution's next state, (N, nx).

    By the method that suits the dynamics, also where they are stiff; inf where none does.
    """
    by_segments = _best(Replayed(solution, "by segments"), _GAP_TOLERANCE)
    return gaps(solution, by_segments)


def _best(replayed: Replayed, tolerance: float) -> ReferenceTrajectory:
    """Integrate by explicit steps and, where they do not resolve it, implicitly."""
    if replayed.solution.problem.model.is_discrete:
        return replayed.explicitly(1)
    explicit = refined(replayed.explicitly, replayed.intervals, tolerance)
    if is_resolved(explicit) or (explicit.is_finite and replayed.intervals > _MANY_INTERVALS):
        return explicit
    implicit = _implicit(replayed)
    apart = abs(implicit.cost - explicit.cost) if explicit.is_finite else 0.0
    is_better = implicit.cost_error < explicit.cost_error
    # Where they disagree, CVODES has stepped over something that is shorter than its steps: an
    # explicit result that converges is nearer to the truth than its last change.
    return implicit if is_better and apart <= explicit.cost_error / 2 else explicit


def _implicit(replayed: Replayed) -> ReferenceTrajectory:
    """Integrate by CVODES with all tolerances; the error is inf where it fails with any."""
    samples = 2 * max(1, -(-_FEWEST_SAMPLES // (2 * replayed.intervals)))
    found: list[ReferenceTrajectory] = []
    for tolerance in _TOLERANCES:
        found.append(replayed.implicitly(samples, tolerance))
        if not found[-1].is_finite:
            return found[-1]
    first, before, last = found
    changes = _OF_LAST * abs(last.cost - before.cost), _OF_LARGEST * abs(last.cost - first.cost)
    error = max(*changes, _CHANCE * _TOLERANCES[-1] * last.cost_size) + ROUNDING * last.cost_size
    return replace(last, cost_error=error, end_error=end_moved(before, last))
