"""On which grids a trajectory is integrated, and what their differences say about its error."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ocp.referee.reference_trajectory import ReferenceTrajectory

# Twice the prime numbers that grow by about 1.6: no two grids share instants but the ends and the
# middle of an interval, where rows often peak; and steps are uneven, in step with no wave.
_SUBSTEPS = (2, 4, 6, 10, 14, 22, 38, 62, 106, 178, 298, 478, 766, 1226, 1966, 3158, 5062, 8102)
_SUBSTEPS = (*_SUBSTEPS, 12982, 20782, 33262)
# The first grid has at least this many steps over the horizon.
_FEWEST_STEPS = 150
# Refinement stops at this many steps, or at this many an interval where that is more.
_MOST_STEPS = 2**15
_MOST_SUBSTEPS_OF_MANY = 22
# Grids that a verdict needs, and that are compared where the last one has not settled.
_GRIDS = 3
_MORE_GRIDS = 5
# Refinement converges as that of a smooth trajectory if each change is this part of the one before;
# then this multiple of the last change bounds the error.
_SMOOTH = 1.0 / 3.0
_OF_CHANGE = 1.5
# The end of a trajectory may move by this many times the tolerance of the cost.
_END = 1e3
# Rounding of a sum, relative to the sum of magnitudes.
ROUNDING = 4.0 * float(np.finfo(float).eps)
# What is left at the last grid and still counts as resolved, cost and end, relative.
_COST_RESOLVED = 1e-3
_END_RESOLVED = 1e-2
# A state that leaves the finite numbers blows up if it was this many times its usual size before;
# else a rate was no number.
_BLOWN_UP = 1e6


def refined(
    integrate: Callable[[int], ReferenceTrajectory], intervals: int, tolerance: float
) -> ReferenceTrajectory:
    """Integrate with more and more steps until cost and end hold still on three grids.

    A trajectory that is not finite is refined as well: explicit steps may be too long.

    Args:
        integrate: with this many steps in every interval.
        intervals: how many there are.
        tolerance: accepted error of the cost, relative to its size.

    Returns:
        the finest one, with its errors; they are inf where fewer than three grids are finite.
    """
    tried: list[ReferenceTrajectory] = []
    for substeps in _ladder(intervals):
        tried = [*tried[1 - _MORE_GRIDS :], integrate(substeps)]
        truth = _with_errors(tried[-_GRIDS:])
        is_settled = truth.cost_error <= tolerance * truth.cost_size
        if is_settled and truth.end_error <= _END * tolerance:
            return truth
    return replace(_with_errors(tried), escape=_escape(tried))


def is_resolved(truth: ReferenceTrajectory) -> bool:
    """Whether cost and end of a trajectory are known well enough to judge it."""
    is_known = truth.cost_error <= _COST_RESOLVED * truth.cost_size
    return truth.is_finite and is_known and truth.end_error <= _END_RESOLVED


def end_moved(before: ReferenceTrajectory, after: ReferenceTrajectory) -> float:
    """Return the distance of two final states, relative to the size of each."""
    size = np.abs(after.x).max(axis=0)
    size = np.maximum(size, 1e-9 * size.max(initial=0.0) or 1.0)
    return float((np.abs(after.x[-1] - before.x[-1]) / size).max())


def _with_errors(tried: list[ReferenceTrajectory]) -> ReferenceTrajectory:
    """Return the last trajectory with errors that explain its distance from those before it.

    Where the changes do not fall as those of a smooth trajectory do, for instance since it has
    corners between the steps, they may be small by chance: then the largest distance counts.
    """
    finite = [each for each in tried if each.is_finite]
    if len(tried) < _GRIDS or not all(each.is_finite for each in tried[-_GRIDS:]):
        return tried[-1]
    *others, last = finite
    costs = np.array([each.cost for each in (*others, last)])
    changes = np.abs(np.diff(costs))
    is_smooth = bool(np.all(changes[1:] <= _SMOOTH * changes[:-1]))
    error = _OF_CHANGE * changes[-1] if is_smooth else 2.0 * np.abs(costs - costs[-1]).max()
    rounding = ROUNDING * np.sqrt(len(last.t)) * last.cost_size
    moved = end_moved(others[-1], last)
    return replace(last, cost_error=float(error + rounding), end_error=moved)


def _ladder(intervals: int) -> Iterator[int]:
    """Yield numbers of steps in every interval."""
    most = max(_MOST_STEPS, _MOST_SUBSTEPS_OF_MANY * intervals)
    chosen = [n for n in _SUBSTEPS if n * intervals >= _FEWEST_STEPS]
    yield from (n for n in chosen if n * intervals <= most)


def _escape(tried: list[ReferenceTrajectory]) -> float | None:
    """Return when the state leaves the finite numbers, if two grids agree on the instant."""
    if len(tried) < 2 or any(each.is_finite for each in tried[-2:]):
        return None
    (before, _), (last, grown) = (_first_lost(each) for each in tried[-2:])
    slack = 1e-3 * (tried[-1].t[-1] - tried[-1].t[0]) + 3.0 * np.diff(tried[-2].t).max()
    return last if abs(last - before) <= slack and grown > _BLOWN_UP else None


def _first_lost(truth: ReferenceTrajectory) -> tuple[float, float]:
    """Return the first instant that is not finite, and by what factor the state grew before."""
    lost = int((~np.isfinite(truth.x).all(axis=1)).argmax())
    size = np.abs(truth.x[:lost]).max(axis=1, initial=0.0)
    grown = size[-1] / np.median(size) if lost and np.median(size) > 0.0 else 0.0
    return float(truth.t[lost]), float(grown)
