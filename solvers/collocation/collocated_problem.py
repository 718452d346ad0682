"""A problem on collocation points as a nonlinear program."""

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from ocp import OCP
from ocp.internal import ConstraintRow, ConstraintRows, RunData, most_violated, time_unit
from solvers.collocation.mesh import CollocationGrid


@dataclass(frozen=True, eq=False)
class CollocationUnknowns:
    """The numbers of a trajectory on a grid of K intervals with M points.

    Attributes:
        z: states at the edges, a free final time below them, (nz, K + 1).
        c: Bernstein coefficients of the controls, (nu, M).
        x: states at the points, (nx, M).
    """

    z: np.ndarray
    c: np.ndarray
    x: np.ndarray

    def joined(self) -> np.ndarray:
        """Return them as one vector, column by column."""
        return np.concatenate([part.ravel(order="F") for part in (self.z, self.c, self.x)])


@dataclass(frozen=True, eq=False)
class CollocatedProblem:
    r"""The dynamics hold at the collocation points, where also the constraints are imposed.

    .. math::

        X_i - x_k - h_k \sum_j A_{ij} f(X_j, u_j) = 0, \qquad
        x_{k+1} - x_k - h_k \sum_j b_j f(X_j, u_j) = 0, \qquad
        u_j = \sum_i B_{ji} c_i

    Unknowns are (z, c, X), see ``CollocationUnknowns``. Path constraints and state bounds hold at
    the points; bounds of the control on its coefficients. A start that is free also meets its
    bounds and the path constraints without control.

    Attributes:
        ocp: the problem.
        grid: edges and points.
    """

    ocp: OCP
    grid: CollocationGrid

    # -- layout -----------------------------------------------------------------------

    @property
    def nz(self) -> int:
        """Unknowns at an edge: the states, and a free final time."""
        return self.ocp.model.nx + int(self.ocp.has_free_time)

    @property
    def fractions(self) -> np.ndarray:
        """All nodes as fractions of the horizon."""
        return self.grid.nodes

    @cached_property
    def _shapes(self) -> tuple[tuple[int, int], ...]:
        edges, points = self.grid.mesh.intervals + 1, len(self.grid.at)
        return (self.nz, edges), (self.ocp.model.nu, points), (self.ocp.model.nx, points)

    def split(self, w: np.ndarray) -> CollocationUnknowns:
        """Return the parts of a vector of unknowns."""
        parts = np.split(w, np.cumsum([a * b for a, b in self._shapes])[:-1])
        shaped = zip(parts, self._shapes, strict=True)
        return CollocationUnknowns(*[part.reshape(shape, order="F") for part, shape in shaped])

    def _filled(self, z: float, c: float, x: float) -> CollocationUnknowns:
        return CollocationUnknowns(
            *[np.full(s, v) for s, v in zip(self._shapes, (z, c, x), strict=True)]
        )

    @property
    def is_control(self) -> np.ndarray:
        """Which unknowns are coefficients of controls."""
        return self._filled(0.0, 1.0, 0.0).joined().astype(bool)

    @property
    def is_later_state(self) -> np.ndarray:
        """Which unknowns are states at points."""
        return self._filled(0.0, 0.0, 1.0).joined().astype(bool)

    def duration(self, w: np.ndarray) -> float:
        """Return final time minus t0 [s] of a vector of unknowns."""
        if not self.ocp.has_free_time:
            return self.ocp.duration
        return float(self.split(w).z[-1, 0]) * self.time_unit

    @cached_property
    def time_unit(self) -> float:
        """What a free final time is measured in [s]."""
        return time_unit(self.ocp)

    # -- the program --------------------------------------------------------------------

    @cached_property
    def program(self) -> dict[str, ca.MX]:
        """Unknowns x, cost f, constraints g and data p, as ``casadi.nlpsol`` takes them."""
        ocp, grid, nx, n_p = self.ocp, self.grid, self.ocp.model.nx, self.ocp.p.numel()
        count, functions = len(grid.at), ocp.functions
        data = ca.MX.sym("data", 1 + n_p * (count + 2))
        t0, p = data[0], ca.reshape(data[1:], n_p, count + 2)
        w = ca.MX.sym("w", sum(a * b for a, b in self._shapes))
        pieces = ca.vertsplit(w, [0, *np.cumsum([a * b for a, b in self._shapes]).tolist()])
        z, c, x = (ca.reshape(v, s) for v, s in zip(pieces, self._shapes, strict=True))
        fixed = ca.MX(ca.DM.ones(1, grid.mesh.intervals + 1) * ocp.duration)
        lengths = self.time_unit * z[nx, :] if ocp.has_free_time else fixed
        lengths, last = lengths[:-1], lengths[-1]
        spread, a, b, basis = self._matrices
        u, h = c @ basis.T, (lengths * ca.DM(grid.mesh.widths).T) @ spread
        t = t0 + (lengths @ spread) * ca.DM(grid.at).T
        now = (x, u, t, p[:, 1:-1])
        slopes = functions.rate.map(count)(*now) * ca.repmat(h, nx, 1)
        costs = functions.running_cost.map(count)(*now) * h
        at_points = x - z[:nx, :-1] @ spread - slopes @ a.T
        at_edges = z[:nx, 1:] - z[:nx, :-1] - slopes @ b
        start, end = (z[:nx, 0], t0, p[:, 0]), (z[:nx, -1], t0 + last, p[:, -1])
        g = [
            ca.vec(at_points),
            ca.vec(at_edges),
            ca.vec(z[nx:, 1:] - z[nx:, :-1]),
            ca.vec(functions.path.map(count)(*now)),
            functions.initial(*start),
            self._first(*start),
            functions.terminal(*end),
        ]
        f = ca.sum2(costs @ b) + functions.terminal_cost(*end)
        return {"x": w, "f": f, "g": ca.vertcat(*g), "p": data}

    @cached_property
    def _matrices(self) -> tuple[ca.DM, ca.DM, ca.DM, ca.DM]:
        """From edges to points (K, M); A (M, M); b (M, K); basis (M, M); all sparse."""
        points = self.grid.points
        blocks = (
            [np.ones((1, p.degree)) for p in points],
            [p.A for p in points],
            [p.b[:, None] for p in points],
            [p.B for p in points],
        )
        # Never as dense arrays: they would have the square of the number of intervals as size.
        spread, a, b, basis = (ca.sparsify(ca.diagcat(*map(ca.DM, rows))) for rows in blocks)
        return spread, a, b, basis

    @cached_property
    def _first(self) -> ca.Function:
        """What a free start alone decides of the path constraints."""
        m = self.ocp.model
        return ca.Function("first", [m.x, m.t, self.ocp.p], [self._first_rows.expression])

    @cached_property
    def _first_rows(self) -> ConstraintRows:
        path = self.ocp.rows.path
        return path.where(~path.on_control & ~self.ocp.decided_by_start)

    @cached_property
    def rows(self) -> tuple[ConstraintRow, ...]:
        """What each row of g says, in order."""
        ocp, grid, last = self.ocp, self.grid, len(self.grid.nodes) - 1
        gap = [
            ConstraintRow(f"dynamics of {name}", "dynamics", 0, 0.0, 0.0)
            for name in ocp.model.x_names
        ]
        time = [ConstraintRow("final time", "time", 0, 0.0, 0.0)] * int(ocp.has_free_time)
        blocks = (
            (gap, grid.point_nodes),
            (gap, grid.edge_nodes[1:]),
            (time, grid.edge_nodes[1:]),
            (ocp.rows.path.rows, grid.point_nodes),
            (ocp.rows.initial.rows, [0]),
            (self._first_rows.rows, [0]),
            (ocp.rows.terminal.rows, [last]),
        )
        return tuple(
            replace(row, node=int(node))
            for block, nodes in blocks
            for node in nodes
            for row in block
        )

    # -- numbers ------------------------------------------------------------------------

    def bounds(self, data: RunData) -> dict[str, np.ndarray]:
        """Return lbx, ubx, lbg, ubg for a start."""
        ocp, nx = self.ocp, self.ocp.model.nx
        result = {}
        for key, side, inf in (("lbx", "lower", -np.inf), ("ubx", "upper", np.inf)):
            state, control, time = (
                np.asarray(getattr(box, side), dtype=float).reshape(-1, 1)
                for box in (ocp.state_bounds, ocp.control_bounds, ocp.time_box)
            )
            all_ = self._filled(inf, 0.0, 0.0)
            all_.z[:nx, 0] = ocp.start_of(data.x0, np.asarray(getattr(ocp.start_box, side)))
            all_.z[nx:] = time[0, 0] / self.time_unit
            all_.c[:] = control
            all_.x[:] = state
            result[key] = all_.joined()
        result["lbg"] = np.array([r.lower for r in self.rows])
        result["ubg"] = np.array([r.upper for r in self.rows])
        return result

    def data_vector(self, data: RunData) -> np.ndarray:
        """Return t0, and the parameters at the start, at every point and at the end."""
        values = data.values
        inside = values.at(self.grid.at, -1)
        rows = np.vstack([values.at(0.0), inside, values.at(1.0)])
        return np.append(data.t0, rows.ravel())

    def worst(
        self, w: np.ndarray, g: np.ndarray, bounds: dict[str, np.ndarray]
    ) -> tuple[float, ConstraintRow | None]:
        """Return the largest violation of any constraint or bound, and which it is."""
        return most_violated(w, g, bounds, self.rows, self._bound)

    def _bound(self, i: int) -> ConstraintRow:
        """Return what the bound of an unknown says."""
        m, grid = self.ocp.model, self.grid
        names = ((*m.x_names, "final time")[: self.nz], m.u_names, m.x_names)
        nodes = (grid.edge_nodes, grid.point_nodes, grid.point_nodes)
        labels = [
            (name, int(node))
            for own, where in zip(names, nodes, strict=True)
            for node in where
            for name in own
        ]
        name, node = labels[i]
        return ConstraintRow(f"bound of {name}", "path", node, 0.0, 0.0)
