"""Defects of a collocated trajectory between its nodes; roll-outs for first guesses."""

from dataclasses import dataclass

import numpy as np

from ocp import OCP, RK4, Solution
from ocp.internal import BufferedFunction, PiecewisePolynomial, RunData, Sizes, Stage, sizes_of
from solvers.collocation.mesh import CollocationGrid

# Steps of RK4 from node to node, for the defects.
_STEPS = 8


@dataclass(frozen=True, eq=False)
class Defects:
    """The dynamics integrated between the nodes, independently of the collocation equations.

    Attributes:
        ocp: the problem.
        grid: its nodes.
        between: some steps from every node to the next, each from its own state.
        chain: one step from node to node.
    """

    ocp: OCP
    grid: CollocationGrid
    between: BufferedFunction
    chain: BufferedFunction

    @classmethod
    def of(cls, ocp: OCP, grid: CollocationGrid) -> "Defects":
        """Build the functions."""
        step, count = Stage.of(ocp, RK4(), held=False, curved=True).step, len(grid.nodes) - 1
        fine = step.mapaccum(_STEPS).map(count)
        return cls(ocp, grid, BufferedFunction(fine), BufferedFunction(step.mapaccum(count)))

    @property
    def _sizes(self) -> Sizes:
        return sizes_of(self.ocp)

    def rollout(self, u: np.ndarray, duration: float, data: RunData) -> np.ndarray:
        """Return the states at the nodes under controls of coefficients (K m, nu), (N + 1, nx)."""
        x, _ = self.chain(data.x0, *self._schedule(u, duration, data, self.grid.nodes))
        return np.vstack([data.x0, x.T])

    def relative(
        self, x: np.ndarray, u: np.ndarray, duration: float, data: RunData
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the defect at each node of the integration from the one before, and its cost.

        Args:
            x: states at the nodes, (N + 1, nx).
            u: coefficients, (K m, nu).
            duration: final time minus t0 [s].
            data: of the run.

        Returns:
            the largest defect between two nodes, relative to the size of a state, 1 at most, + its
            largest abs(x) along the trajectory, (N,), and the running cost between them, (N,).
        """
        nodes, inside = self.grid.nodes, np.arange(_STEPS) / _STEPS
        fine = (nodes[:-1, None] + inside * np.diff(nodes)[:, None]).ravel()
        schedule = self._schedule(u, duration, data, np.append(fine, 1.0))
        steps, costs = self.between(x[:-1].T, *schedule)
        after = steps[:, _STEPS - 1 :: _STEPS].T
        moved = np.abs(after - x[1:]) / (np.minimum(self._sizes.x, 1.0) + np.abs(x).max(axis=0))
        return moved.max(axis=1), costs.reshape(-1, _STEPS).sum(axis=1)

    def errors(self, solution: Solution) -> np.ndarray:
        """Return the error of each interval of a solution on this grid, (K,).

        Its largest relative defect, or the difference of the running cost from the
        quadrature of the interval, relative to the size of the cost, 1 at most, + abs(cost).
        """
        begins = self.grid.edge_nodes[:-1]
        given = (solution.x, solution.u, solution.duration, solution.data)
        moved, costs = self.relative(*given)
        of_cost = np.add.reduceat(costs, begins) - self._quadrature(*given)
        return np.maximum(
            np.maximum.reduceat(moved, begins),
            np.abs(of_cost) / (min(self._sizes.cost, 1.0) + abs(solution.cost)),
        )

    def _quadrature(
        self, x: np.ndarray, u: np.ndarray, duration: float, data: RunData
    ) -> np.ndarray:
        """Running cost of each interval by the weights of its points, (K,)."""
        grid = self.grid
        at_points = self._polynomials(u).at(grid.at, grid.owner)
        t, p = data.t0 + grid.at * duration, data.values.at(grid.at, -1)
        now = (x[grid.point_nodes].T, at_points.T, t[None, :], p.T)
        costs = np.array(self.ocp.functions.running_cost.map(len(t))(*now)).ravel()
        weights = np.concatenate([scheme.b for scheme in grid.points])
        share = np.bincount(grid.owner, weights * costs, grid.mesh.intervals)
        return duration * grid.mesh.widths * share

    def _schedule(
        self, u: np.ndarray, duration: float, data: RunData, nodes: np.ndarray
    ) -> list[np.ndarray]:
        """Controls, times, lengths and parameters of steps between fractions of the horizon."""
        pieces, middle = self._polynomials(u), (nodes[1:] + nodes[:-1]) / 2
        piece = pieces.of(middle)
        drive = [pieces.at(at, piece).T for at in (nodes[:-1], middle, nodes[1:])]
        left, right = data.values.on(nodes)
        t, h = data.t0 + nodes[None, :-1] * duration, np.diff(nodes)[None, :] * duration
        return [*drive, t, h, left.T, right.T]

    def _polynomials(self, u: np.ndarray) -> PiecewisePolynomial:
        """The controls of coefficients (K m, nu) over fractions of the horizon."""
        mesh, nu = self.grid.mesh, self.ocp.model.nu
        shape = (mesh.intervals, len(u) // mesh.intervals, nu)  # nu may be 0: no -1 here
        return PiecewisePolynomial(np.asarray(mesh.edges), u.reshape(shape))
