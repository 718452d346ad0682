"""How large costs and rows of a problem are: what their errors are compared with."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.problem.constraint import Box
from ocp.solution.solution import Solution

# What is this part of its size counts as zero.
_ZERO = 1e-6
# Smaller states and controls are what an iteration has left of zero, and tell no size.
_SMALLEST = 1e-6


@dataclass(frozen=True, eq=False)
class SampledSizes:
    """Sizes read off a solution and a neighbour, displaced by the size of states and controls.

    They have the units of what they measure, and are not zero where the solution itself makes a
    cost or a row zero.

    Attributes:
        solution: the solution.
    """

    solution: Solution

    @cached_property
    def states(self) -> np.ndarray:
        """Sizes of the states, from the solution and the bounds, (nx,)."""
        box = self.solution.problem.state_bounds
        return _size(self.solution.x, np.abs(self.solution.x0), box)

    @cached_property
    def controls(self) -> np.ndarray:
        """Sizes of the controls, from the solution and the bounds, (nu,)."""
        return _size(self.solution.u, np.zeros(1), self.solution.problem.control_bounds)

    @property
    def state_floor(self) -> np.ndarray:
        """What counts as zero of a state, (nx,)."""
        return _ZERO * self.states

    @property
    def cost_floor(self) -> float:
        """What counts as zero of the cost."""
        functions, duration = self.solution.problem.functions, self.solution.duration
        steps = self.solution.problem.steps
        running = self._change(functions.running_cost).sum() * (steps or duration)
        return _ZERO * float(running + self._change(functions.terminal_cost).sum())

    @property
    def path_floor(self) -> np.ndarray:
        """What counts as zero of each path constraint, (m,)."""
        return _ZERO * self._change(self.solution.problem.functions.path)

    def of_end(self, row: ca.Function) -> np.ndarray:
        """Return the sizes of rows of (x, t, p): values along the solution, or what is zero."""
        s = self.solution
        p = s.data.values.at(s.fractions)
        values = np.array(row.map(len(s.t))(s.x.T, s.t[None, :], p.T)).T
        return np.maximum(np.abs(values).max(axis=0), _ZERO * self._change(row))

    def _change(self, function: ca.Function) -> np.ndarray:
        """By how much a function of (x, u, t, p) or (x, t, p) changes under the displacement."""
        s, changes = self.solution, []
        for k in (0, len(s.t) // 2, len(s.t) - 1):
            t, p = s.t[k], s.data.values.at(s.fractions[k])[0]
            u = [np.zeros(s.problem.model.nu)] if function.n_in() == 4 else []
            shifted = [self.controls] if u else []
            here = np.array(function(s.x[k], *u, t, p)).ravel()
            there = np.array(function(s.x[k] + self.states, *shifted, t, p)).ravel()
            changes.append(np.abs(there - here))
        return np.nan_to_num(np.max(changes, axis=0), nan=0.0, posinf=0.0)


def _size(values: np.ndarray, given: np.ndarray, box: Box) -> np.ndarray:
    """Return the size of each column of values: from data, as it occurs, or 1 where it is zero.

    Args:
        values: (K, n).
        given: what the problem gives, (n,) or (1,), not negative.
        box: bounds.
    """
    bounds = np.abs(np.array([np.broadcast_to(b, values.shape[1]) for b in (box.lower, box.upper)]))
    data = np.maximum(given, np.where(np.isfinite(bounds), bounds, 0.0).max(axis=0))
    occurs = np.abs(values).max(axis=0, initial=0.0)
    known = np.maximum(data, np.where(occurs > _SMALLEST, occurs, 0.0))
    return np.where(known > 0.0, known, 1.0)
