"""Bellman's recursion on a grid: value function, policy and reachable sets."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ocp import OCP
from ocp.internal import ConstraintRows, RunData
from solvers.tabular.grid_functions import GridFunctions
from solvers.tabular.state_grid import StateGrid

# A bound or constraint counts as met within this, relative to 1 + abs(bound): rounding only.
_MET = 1e-9


@dataclass(frozen=True, eq=False)
class ValueFunction:
    """What the recursion knows of every point of the grid.

    Attributes:
        grid: the points of the states.
        t: nodes [s], (N + 1,).
        value: cost-to-go (2.22), (N + 1, size), ``inf`` where no trajectory is feasible.
        policy: minimising control, (N, size, nu); without meaning where ``value`` is ``inf``.
    """

    grid: StateGrid
    t: np.ndarray
    value: np.ndarray
    policy: np.ndarray

    @property
    def field(self) -> np.ndarray:
        """The value function in the shape of the grid, (N + 1, points of each axis)."""
        return self.value.reshape(len(self.t), *self.grid.shape)

    @property
    def reachable(self) -> np.ndarray:
        """Whether a point can be steered into the terminal set: the sets of 2.25 and 2.29.

        They lie inside the true ones, by up to a cell: a cell counts only as a whole.

        Returns:
            booleans (N + 1, points of each axis).
        """
        return np.isfinite(self.field)

    def cost_to_go(self, k: int, x: np.ndarray) -> np.ndarray:
        """Return the value function of node k at x (n, nx), (n,); ``inf`` where infeasible."""
        matrix, inside = self.grid.interpolation(x)
        return np.where(inside, matrix @ self.value[k], np.inf)

    def slope(self, k: int, x: np.ndarray) -> np.ndarray:
        """Return the gradient of the value function of node k at x (nx,), (nx,).

        Differences of neighbouring values, interpolated as the values are.
        """
        matrix, _ = self.grid.interpolation(x[None, :])
        return (matrix @ self.grid.slopes(self.value[k]))[0]


@dataclass(frozen=True, eq=False)
class Bellman:
    r"""One step back, for all points and controls at once.

    .. math::

        J_{k}(x) = \min_{u} \; q_k(x, u) + J_{k+1}(g_k(x, u)), \qquad
        h(x, u) \le 0, \quad g_k(x, u) \in X_{k+1 \to N}

    The next state is interpolated multilinearly, which is a sparse matrix: it is made once
    unless the dynamics depend on time. Source: thesis (2.26) to (2.33), [Bellman 1957].

    Attributes:
        ocp: the problem.
        grid: the points of the states.
        controls: the controls that are tried.
        n: number of steps.
        functions: of a step, and of the last node.
        slack: by how much a terminal constraint may be missed.
    """

    ocp: OCP
    grid: StateGrid
    controls: StateGrid
    n: int
    functions: GridFunctions
    slack: float

    # -- the recursion --------------------------------------------------------------------

    def table(self, data: RunData) -> ValueFunction:
        """Return value function and policy for the numbers of a run."""
        times, common = self.schedule(data)
        value = np.empty((self.n + 1, self.grid.size))
        policy = np.empty((self.n, self.grid.size, self.ocp.model.nu))
        value[-1] = self.final(data)
        x, u = self._all_pairs()
        f = self.functions
        after, cost = self.step(x, u, common[-1], first=False)
        matrix, inside = self.grid.interpolation(after)
        for k in reversed(range(self.n)):
            if k < self.n - 1 and (f.state_varies or f.cost_varies):
                after, cost = self.step(x, u, common[k], first=False)
            if k < self.n - 1 and f.state_varies:
                matrix, inside = self.grid.interpolation(after)
            cost[~inside] = np.inf
            total = (matrix @ value[k + 1] + cost).reshape(self.grid.size, -1)
            value[k], policy[k] = self.minimum(total)
        return ValueFunction(self.grid, times, value, policy)

    def final(self, data: RunData) -> np.ndarray:
        """Return the cost of the last node on the terminal set, inf outside it (2.30, 2.31)."""
        x, p = self.grid.points, data.values.at(1.0)[0]
        t = np.array([data.t0 + self.ocp.duration])
        cost = self.functions.terminal_cost([x], [t, p])[:, 0]
        met = self._in_state_bounds(x)
        met &= _met(self.functions.last([x], [t, p]), self.functions.without_control)
        met &= _met(self.functions.terminal([x], [t, p]), self.ocp.rows.terminal, self.slack)
        return np.where(met & np.isfinite(cost), cost, np.inf)

    def minimum(self, total: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the least of each row (n, controls), and its control (n, nu).

        With one control and a smooth cost, the minimum of the parabola through the least
        one and its neighbours.
        """
        best = total.argmin(axis=1)
        rows = np.arange(len(total))
        value, control = total[rows, best], self.controls.points[best]
        if self.ocp.model.nu != 1 or self.ocp.smoothness == 0:
            return value, control
        middle = np.clip(best, 1, total.shape[1] - 2)
        left, right = total[rows, middle - 1], total[rows, middle + 1]
        fit = np.flatnonzero((middle == best) & np.isfinite(value + left + right))
        shift, gain = _vertex(left[fit], value[fit], right[fit])
        value, control = value.copy(), control.copy()
        value[fit] -= gain
        control[fit, 0] += shift * self.controls.axes[0].step
        return value, control

    # -- pairs of state and control ---------------------------------------------------------

    def schedule(self, data: RunData) -> tuple[np.ndarray, list[list[np.ndarray]]]:
        """Return the nodes [s], (N + 1,), and for each step its t, h, p0 and p1."""
        nodes = np.linspace(0.0, 1.0, self.n + 1)
        t = data.t0 + nodes * self.ocp.duration
        left, right = data.values.on(nodes)
        h = np.array([self.ocp.duration / self.n])
        return t, [[t[k : k + 1], h, left[k], right[k]] for k in range(self.n)]

    def step(
        self, x: np.ndarray, u: np.ndarray, common: list[np.ndarray], *, first: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the next states (n, nx) and the costs (n,), inf where a constraint is broken.

        Args:
            x: states (n, nx).
            u: controls (n, nu).
            common: t, h, p0 and p1 of the step.
            first: whether x is the start: what it alone decides is then not imposed.
        """
        stepped = self.functions.step([x, u], common)
        path = self.functions.path([x, u], [common[0], common[2]])
        rows = self.ocp.rows.path
        counted = rows.on_control | (not first)
        met = _met(path[:, counted], rows.where(counted))
        if not first:
            met &= self._in_state_bounds(x)
        cost = stepped[:, -1]
        return stepped[:, :-1], np.where(met & np.isfinite(cost), cost, np.inf)

    @cached_property
    def pairs(self) -> int:
        """Number of pairs of state and control."""
        return self.grid.size * self.controls.size

    def _all_pairs(self) -> tuple[np.ndarray, np.ndarray]:
        x = np.repeat(self.grid.points, self.controls.size, axis=0)
        return x, np.tile(self.controls.points, (self.grid.size, 1))

    def _in_state_bounds(self, x: np.ndarray) -> np.ndarray:
        return _met(x, self.ocp.rows.states)


def _vertex(
    left: np.ndarray, middle: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where the parabola through -1, 0 and 1 is least, and by how much below the middle."""
    curvature, slope = left - 2.0 * middle + right, (right - left) / 2.0
    convex = curvature > 0.0
    shift = np.divide(-slope, curvature, out=np.zeros_like(curvature), where=convex)
    return shift, 0.5 * curvature * shift**2


def _met(values: np.ndarray, rows: ConstraintRows, slack: float = 0.0) -> np.ndarray:
    """Return which of the points meet all rows, but for rounding and a slack."""
    lower, upper = np.asarray(rows.box.lower), np.asarray(rows.box.upper)
    low = np.where(np.isfinite(lower), lower - slack - _MET * (1.0 + np.abs(lower)), -np.inf)
    high = np.where(np.isfinite(upper), upper + slack + _MET * (1.0 + np.abs(upper)), np.inf)
    return np.all((values >= low) & (values <= high), axis=1)
