"""A linear-quadratic problem as a quadratic program: sparse in (x, u), or condensed to inputs."""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ocp.internal import ConstraintRow, ControlBlocks, LinearQuadratic, LQData, Matrices
from solvers.linear import regulator_gains as recursion
from solvers.linear.qp.quadratic_program import QpVectors
from solvers.linear.stacked_prediction import StackedPrediction

# A point as (x (N + 1, n), u (N, m)).
Trajectory = tuple[np.ndarray, np.ndarray]


class FormPosition(NamedTuple):
    """What a row of the program says, for messages and penalties.

    Attributes:
        name: of the constraint, or of the bound.
        node: where it holds, 0 to N.
        limits_input: whether it limits what is sent, so that no penalty makes it soft.
        unit: what a violation of 1 is in the units of the user.
    """

    name: str
    node: int
    limits_input: bool
    unit: float

    @classmethod
    def of(cls, row: ConstraintRow, node: int) -> "FormPosition":
        """Return what a row says at a node where an input is sent."""
        return cls(row.name, node, row.kind == "input", row.unit)


class MPCForm(ABC):
    """How unknowns and rows are laid out.

    The rows of the constraints come last: those of node 0 that have a control, then of the
    nodes 1 to N - 1, then of node N. Node 0 is measured, so nothing constrains its state.

    Attributes:
        lq: the problem.
        equations: number of rows before them.
        blocks: controls that are held over several steps, by equations that come next.
        H: for the matrices last given.
        G: for the matrices last given.
    """

    def __init__(self, lq: LinearQuadratic, defects: int, blocks: ControlBlocks | None) -> None:
        """Name the rows."""
        self.lq, self.blocks = lq, blocks
        # The steps that go on with the control of the one before, and which controls do.
        self._later = np.flatnonzero(blocks.follows) if blocks else np.empty(0, dtype=int)
        self._held = blocks.held if blocks else np.empty(0, dtype=int)
        self.equations = defects + self._later.size * self._held.size
        self.H, self.G = sp.csc_matrix((0, 0)), sp.csc_matrix((0, 0))
        on_control = [row for row, on in zip(lq.rows, lq.on_control, strict=True) if on]
        first = [FormPosition.of(row, 0) for row in on_control]
        later = [FormPosition.of(row, k) for k in range(1, lq.steps) for row in lq.rows]
        last = [FormPosition(row.name, lq.steps, False, row.unit) for row in lq.end_rows]
        self.places = (*first, *later, *last)

    @abstractmethod
    def set_matrices(self, matrices: Matrices) -> None:
        """Fill H and G."""

    @abstractmethod
    def vectors(self, data: LQData, x0: np.ndarray) -> QpVectors:
        """Return g, l and u."""

    @abstractmethod
    def trajectory(self, z: np.ndarray, data: LQData, x0: np.ndarray) -> Trajectory:
        """Return states and controls of a point."""

    @abstractmethod
    def point(self, x: np.ndarray, u: np.ndarray, data: LQData) -> np.ndarray:
        """Return the point of states and controls: a warm start."""

    @abstractmethod
    def costates(
        self, y: np.ndarray, data: LQData, x_end: np.ndarray, half: np.ndarray
    ) -> np.ndarray:
        """Return the costates (N + 1, n); at an active bound the value just before the node.

        Args:
            y: multipliers of all rows.
            data: the numbers of the run.
            x_end: last state (n,).
            half: half the slopes of the running cost (N, n + m).
        """

    def split(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the multipliers of the stage rows (N, rows) and of the end rows."""
        lq, own = self.lq, y[self.equations :]
        on, count = lq.on_control, len(lq.rows)
        stage = np.zeros((lq.steps, count))
        first = int(on.sum())
        stage[0, on] = own[:first]
        middle = first + (lq.steps - 1) * count
        stage[1:] = own[first:middle].reshape(lq.steps - 1, count)
        return stage, own[middle:]

    def _bounds(self, data: LQData) -> list[np.ndarray]:
        """Return lower and upper bounds of the constraint rows."""
        on = self.lq.on_control
        return [
            np.concatenate([stage[0, on], stage[1:].ravel(), end])
            for stage, end in ((data.lower, data.lower_f), (data.upper, data.upper_f))
        ]


class Sparse(MPCForm):
    """Unknowns (u_0, x_1, u_1, ..., x_N): effort linear in the number of steps."""

    def __init__(self, lq: LinearQuadratic, blocks: ControlBlocks | None = None) -> None:
        """Lay out rows and columns once."""
        n, m, steps = lq.ocp.model.nx, lq.ocp.model.nu, lq.steps
        super().__init__(lq, steps * n, blocks)
        start = np.arange(steps)[:, None] * (n + m)
        self._u = start + np.arange(m)
        self._after = start + m + np.arange(n)
        self._hessian: _Pattern | None = None
        self._rows: _Pattern | None = None

    def set_matrices(self, matrices: Matrices) -> None:
        """Fill the values in; where matrices change, zeros are kept so that the pattern stays."""
        keep_zeros = self.lq.fixed is None
        if self._hessian is None or self._rows is None:
            self._hessian = _Pattern.of(self._hessian_blocks(matrices), self._size, keep_zeros)
            self._rows = _Pattern.of(self._row_blocks(matrices), self._size, keep_zeros)
        self.H = self._hessian.filled(self._hessian_blocks(matrices))
        self.G = self._rows.filled(self._row_blocks(matrices))

    @property
    def _size(self) -> int:
        return self._u.size + self._after.size

    def _hessian_blocks(self, m: Matrices) -> list["_Block"]:
        both = np.hstack([self._after[:-1], self._u[1:]])
        last = self._after[-1:]
        return [
            _Block(self._u[:1], self._u[:1], 2.0 * m.R[:1]),
            _Block(both, both, 2.0 * m.weights[1:]),
            _Block(last, last, 2.0 * m.P[None]),
        ]

    def _row_blocks(self, m: Matrices) -> list["_Block"]:
        steps, n = self._after.shape
        on, count = self.lq.on_control, len(self.lq.rows)
        defects = np.arange(steps * n).reshape(steps, n)
        held = np.arange(steps * n, self.equations).reshape(-1, max(1, self._held.size))
        first = self.equations + np.arange(int(on.sum()))[None]
        middle = self.equations + first.size + np.arange((steps - 1) * count)
        middle = middle.reshape(steps - 1, count)
        end = self.equations + first.size + middle.size + np.arange(len(self.lq.end_rows))[None]
        same = np.repeat(np.eye(self._held.size)[None], len(held), axis=0)
        return [
            _Block(held, self._u[np.ix_(self._later, self._held)], same),
            _Block(held, self._u[np.ix_(self._later - 1, self._held)], -same),
            _Block(defects, self._after, np.repeat(np.eye(n)[None], steps, axis=0)),
            _Block(defects[1:], self._after[:-1], -m.A[1:]),
            _Block(defects, self._u, -m.B),
            _Block(first, self._u[:1], m.D_u[:1, on]),
            _Block(middle, self._after[:-1], m.D_x[1:]),
            _Block(middle, self._u[1:], m.D_u[1:]),
            _Block(end, self._after[-1:], m.D_f[None]),
        ]

    def vectors(self, data: LQData, x0: np.ndarray) -> QpVectors:
        """Return g, l and u."""
        m, on, first = data.matrices, self.lq.on_control, int(self.lq.on_control.sum())
        g = np.empty(self._size)
        g[self._u] = 2.0 * data.r
        g[self._u[0]] += 2.0 * (x0 @ m.S[0])
        g[self._after[:-1]] = 2.0 * data.q[1:]
        g[self._after[-1]] = 2.0 * data.p
        defects = data.c.copy()
        defects[0] += m.A[0] @ x0
        low, high = self._bounds(data)
        known = m.D_x[0, on] @ x0
        low[:first] -= known
        high[:first] -= known
        rows = np.append(defects.ravel(), np.zeros(self.equations - defects.size))
        return QpVectors(g, np.concatenate([rows, low]), np.concatenate([rows, high]))

    def trajectory(self, z: np.ndarray, data: LQData, x0: np.ndarray) -> Trajectory:
        """Return states and controls."""
        return np.vstack([x0, z[self._after]]), z[self._u]

    def point(self, x: np.ndarray, u: np.ndarray, data: LQData) -> np.ndarray:
        """Return (u_0, x_1, u_1, ..., x_N)."""
        z = np.empty(self._size)
        z[self._u], z[self._after] = u, x[1:]
        return z

    def costates(
        self, y: np.ndarray, data: LQData, x_end: np.ndarray, half: np.ndarray
    ) -> np.ndarray:
        """Return minus the multipliers of x_{k+1} - A x_k - B u_k = c_k, and what follows at 0."""
        m = data.matrices
        later = -y[: self._after.size].reshape(self._after.shape)
        first = 2.0 * half[0, : len(x_end)] + later[0] @ m.A[0] + self.split(y)[0][0] @ m.D_x[0]
        return np.vstack([first, later])


class Condensed(MPCForm):
    """Unknowns V of u = -Kx + v (2.83 to 2.91): few and dense, for short horizons."""

    def __init__(self, lq: LinearQuadratic, blocks: ControlBlocks | None = None) -> None:
        """Wait for the matrices."""
        super().__init__(lq, 0, blocks)
        self._prediction: StackedPrediction | None = None

    def set_matrices(self, matrices: Matrices) -> None:
        """Stack the matrices."""
        feedback = recursion.stabilising(matrices, self.lq.ocp.name)
        self._prediction = p = StackedPrediction.of(matrices, feedback)
        on, stage = self.lq.on_control, matrices.D @ p.stages
        width = p.end.shape[1]
        held = self._changes(p.stages[:, matrices.A.shape[1] :])
        rows = [held.reshape(-1, width), stage[0, on]]
        rows += [stage[1:].reshape(-1, width), matrices.D_f @ p.end]
        self.H, self.G = sp.csc_matrix(p.hessian), sp.csc_matrix(np.vstack(rows))

    @property
    def _stacked(self) -> StackedPrediction:
        assert self._prediction is not None
        return self._prediction

    def vectors(self, data: LQData, x0: np.ndarray) -> QpVectors:
        """Return g, l and u."""
        m, on = data.matrices, self.lq.on_control
        z, x_end = self._stacked.nominal(data, x0)
        rows = (m.D @ z[:, :, None])[:, :, 0]
        known = np.concatenate([rows[0, on], rows[1:].ravel(), m.D_f @ x_end])
        low, high = self._bounds(data)
        held = -self._changes(z[:, len(x0) :]).ravel()
        low, high = (np.append(held, bound - known) for bound in (low, high))
        return QpVectors(self._stacked.gradient(data, z, x_end), low, high)

    def trajectory(self, z: np.ndarray, data: LQData, x0: np.ndarray) -> Trajectory:
        """Return states and controls."""
        return self._stacked.trajectory(data, x0, z)

    def point(self, x: np.ndarray, u: np.ndarray, data: LQData) -> np.ndarray:
        """Return V = u + Kx."""
        return (u + (self._stacked.feedback @ x[:-1, :, None])[:, :, 0]).ravel()

    def costates(
        self, y: np.ndarray, data: LQData, x_end: np.ndarray, half: np.ndarray
    ) -> np.ndarray:
        """Return the adjoint of cost and constraints."""
        m, (stage, end) = data.matrices, self.split(y)
        slope, n = 2.0 * half + (stage[:, None] @ m.D)[:, 0], len(x_end)
        by_u, held = slope[:, n:], y[: self.equations].reshape(self._later.size, self._held.size)
        by_u[np.ix_(self._later, self._held)] += held
        by_u[np.ix_(self._later - 1, self._held)] -= held
        final = 2.0 * (m.P @ x_end + data.p) + end @ m.D_f
        return self._stacked.costates(slope[:, :n], by_u, final)

    def _changes(self, u: np.ndarray) -> np.ndarray:
        """Return by how much the controls (N, nu, ...) change where they are held."""
        return u[np.ix_(self._later, self._held)] - u[np.ix_(self._later - 1, self._held)]


class _Block(NamedTuple):
    """K dense blocks: rows (K, a), columns (K, b), values (K, a, b)."""

    rows: np.ndarray
    columns: np.ndarray
    values: np.ndarray


class _Pattern(NamedTuple):
    """Where the values of blocks stand in a matrix that is sparse by columns."""

    order: np.ndarray
    rows: np.ndarray
    starts: np.ndarray
    shape: tuple[int, int]

    @classmethod
    def of(cls, blocks: list[_Block], width: int, keep_zeros: bool) -> "_Pattern":
        """Sort the entries by columns."""
        rows = np.concatenate(
            [np.broadcast_to(b.rows[:, :, None], b.values.shape).ravel() for b in blocks]
        )
        columns = np.concatenate(
            [np.broadcast_to(b.columns[:, None, :], b.values.shape).ravel() for b in blocks]
        )
        values = np.concatenate([b.values.ravel() for b in blocks])
        kept = np.arange(len(values)) if keep_zeros else np.flatnonzero(values)
        order = kept[np.lexsort((rows[kept], columns[kept]))]
        height = 1 + max((int(b.rows.max()) for b in blocks if b.rows.size), default=-1)
        starts = np.searchsorted(columns[order], np.arange(width + 1))
        return cls(order, rows[order], starts, (height, width))

    def filled(self, blocks: list[_Block]) -> sp.csc_matrix:
        """Return the matrix with the values of blocks laid out alike."""
        values = np.concatenate([b.values.ravel() for b in blocks])[self.order]
        return sp.csc_matrix((values, self.rows, self.starts), shape=self.shape)
