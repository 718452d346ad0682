"""Where a trajectory crosses a switch at which dynamics, cost or constraints jump."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks.arguments import check_instance
from ocp.problem.switches import Switches, switches
from ocp.solution.solution import Solution

# So many instants between two nodes at which the branches are compared.
_SAMPLES = 8
# Halvings of the distance between two instants on different branches.
_HALVINGS = 45
# A change across a switch is a jump where it exceeds this share of the largest value.
_JUMP = 1e-6


@dataclass(frozen=True)
class Jump:
    """One crossing.

    Attributes:
        t: when [s].
        what: the value that jumps, in words: a rate, the running cost, a path constraint.
        amount: by how much, in the unit of that value.
        switch: the expression that switches.
    """

    t: float
    what: str
    amount: float
    switch: str

    def __str__(self) -> str:
        """Return a sentence that tells what to do."""
        return (
            f"{self.what} jumps by {self.amount:.3g} at t = {self.t:.4g} s, where {self.switch} "
            "switches; derivatives do not see a jump, so this need not be an optimum on any "
            "grid. Describe each branch as a phase of its own whose duration is free (states "
            "scaled to one horizon), or replace the switch by a smooth transition, such as "
            "(1 + tanh(d / width)) / 2 of the difference d of its two sides, and reduce its width"
        )


def jumps_along(solution: Solution) -> tuple[Jump, ...]:
    """Return every jump that the trajectory of a solution crosses, in the order of time.

    The branches taken are compared at eight instants an interval, between the nodes by the
    solution's own interpolation, and where they differ dynamics, running cost and path
    constraints are evaluated on both sides. A switch at which none of them jumps (both branches
    have the same value there: a kink) is no jump. A detour through a branch that is shorter than
    an eighth of an interval is not seen. Nothing is returned for a model in discrete time, whose
    trajectory has no way between its instants.
    """
    check_instance(solution, Solution, "jumps_along: the solution")
    found = switches(solution.problem)
    if found is None or solution.problem.model.is_discrete:
        return ()
    points = _samples(solution)
    levels = _evaluated(found.levels, points, solution)
    crossed = np.flatnonzero((levels[1:] != levels[:-1]).any(axis=1))
    if not crossed.size:
        return ()
    left, right = _bisected(found, points[crossed], points[crossed + 1], solution)
    size = np.abs(_evaluated(found.values, points, solution)).max(axis=0)
    below, above = (_evaluated(found.values, side, solution) for side in (left, right))
    branches = [_evaluated(found.levels, side, solution) for side in (left, right)]
    result = []
    for i in range(len(crossed)):
        change = np.nan_to_num(np.abs(above[i] - below[i]), nan=np.inf)
        excess = change - _JUMP * np.maximum(size, np.finfo(float).tiny)
        worst = int((change / np.maximum(size, np.finfo(float).tiny)).argmax())
        if excess[worst] > 0.0:
            switch = int(np.flatnonzero(branches[0][i] != branches[1][i])[0])
            when = float(right[i, solution.problem.model.nx + solution.problem.model.nu])
            result.append(
                Jump(when, found.names[worst], float(change[worst]), found.labels[switch])
            )
    return tuple(result)


def _samples(solution: Solution) -> np.ndarray:
    """Return x, u and t side by side at instants between the nodes, (N samples, nx + nu + 1)."""
    inside = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    t = (solution.t[:-1, None] + inside * np.diff(solution.t)[:, None]).ravel()
    return np.hstack([solution.state(t), solution.control(t), t[:, None]])


def _evaluated(function: ca.Function, points: np.ndarray, solution: Solution) -> np.ndarray:
    """Return a function of (x, u, t, p) at some points, one row each."""
    nx, nu = solution.problem.model.nx, solution.problem.model.nu
    x, u, t = points[:, :nx].T, points[:, nx : nx + nu].T, points[:, nx + nu :].T
    fractions = np.clip((t[0] - solution.t[0]) / solution.duration, 0.0, 1.0)
    p = solution.data.values.at(fractions).T
    return np.array(function.map(len(points))(x, u, t, p)).T


def _bisected(
    found: Switches, left: np.ndarray, right: np.ndarray, solution: Solution
) -> tuple[np.ndarray, np.ndarray]:
    """Return points on both sides of a switch, so close that only a jump lies between them."""
    branch = _evaluated(found.levels, left, solution)
    for _ in range(_HALVINGS):
        middle = (left + right) / 2.0
        same = (_evaluated(found.levels, middle, solution) == branch).all(axis=1)[:, None]
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    return left, right
