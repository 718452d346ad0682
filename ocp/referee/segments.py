"""Trajectories judged from node to node: when, how far the nodes are off, and how errors grow."""

import numpy as np

from ocp.referee.reference_trajectory import ReferenceTrajectory, Replayed
from ocp.solution.solution import Solution

# Open loop counts where it leaves the solution's nodes by at most this, relative to each state.
_NEAR = 1e-3
# It does not count where it leaves them by this many times what all segments are off by,
_AMPLIFIED = 1e4
# and no segment is off by more than this; in discrete time by rounding.
_GAP = 1e-2
_DISCRETE_GAP = 1e-8
# Displacement of the starts from which the growth of errors is read off, relative.
_DISPLACEMENT = 1e-4


def is_amplified(in_open_loop: ReferenceTrajectory, by_segments: Replayed) -> bool:
    """Whether the dynamics amplify the tiny errors of a solution until open loop means nothing."""
    solution = by_segments.solution
    size = state_sizes(solution)
    left = (defects(solution, in_open_loop) / size).max()
    if left <= _NEAR:
        return False
    off = gaps(solution, _alike(by_segments, in_open_loop)) / size
    limit = _DISCRETE_GAP if solution.problem.model.is_discrete else _GAP
    most, total = off.max(), off.max(axis=1).sum()
    return bool(most <= limit and left > _AMPLIFIED * total)


def defects(solution: Solution, truth: ReferenceTrajectory) -> np.ndarray:
    """Return the distances of the solution's states from the true ones at its nodes, (N + 1, nx).

    Inf where the trajectory is not finite.
    """
    own = np.stack([np.interp(solution.t, truth.t, c) for c in truth.x.T], axis=1)
    return np.nan_to_num(np.abs(own - solution.x), nan=np.inf, posinf=np.inf)


def gaps(solution: Solution, truth: ReferenceTrajectory) -> np.ndarray:
    """Return by how much the end of each segment misses the solution's next node, (N, nx)."""
    return np.nan_to_num(np.abs(_signed_gaps(solution, truth)), nan=np.inf, posinf=np.inf)


def worth(solution: Solution, truth: ReferenceTrajectory) -> float:
    """Return what the gaps change the cost by, to first order: the sum of costate' gap."""
    later, _ = _ends(solution, truth)
    return abs(float((solution.costate[later] * _signed_gaps(solution, truth)).sum()))


def growth(solution: Solution, truth: ReferenceTrajectory) -> float:
    """Return by how much an error of the state grows in open loop, at most, relative to its size.

    From the product of the segments' derivatives, by finite differences.
    """
    size, nx = state_sizes(solution), solution.x.shape[1]
    columns = []
    _, last = _ends(solution, truth)
    for shift in _DISPLACEMENT * np.diag(size):
        moved = _alike(Replayed(solution, truth.replay, shift), truth)
        columns.append((moved.ends - truth.ends)[last] / size / _DISPLACEMENT)
    flow, log, least, most = np.eye(nx), 0.0, 0.0, 0.0
    for slope in np.stack(columns, axis=2):
        flow = slope @ flow
        norm = float(np.linalg.norm(flow))
        if not 0.0 < norm < np.inf:
            break
        flow, log = flow / norm, log + np.log(norm)
        least, most = min(least, log), max(most, log - least)
    return float(np.exp(min(most, 700.0)))


def state_sizes(solution: Solution) -> np.ndarray:
    """Return the largest magnitude of each state, (nx,), positive."""
    size = np.abs(solution.x).max(axis=0)
    return np.maximum(size, 1e-9 * size.max(initial=0.0) or 1.0)


def _alike(replayed: Replayed, truth: ReferenceTrajectory) -> ReferenceTrajectory:
    """Integrate by the method of another trajectory, once."""
    if truth.method == "explicit":
        return replayed.explicitly(truth.substeps)
    return replayed.implicitly(truth.substeps, 1e-9)


def _signed_gaps(solution: Solution, truth: ReferenceTrajectory) -> np.ndarray:
    later, last = _ends(solution, truth)
    return truth.ends[last] - solution.x[later]


def _ends(solution: Solution, truth: ReferenceTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes at which segments end, and the last step of each."""
    knots, nodes = np.unique(Replayed(solution).node_knots, return_index=True)
    return nodes[1:], knots[1:] * truth.substeps - 1
