"""The boundary value problem of the minimum principle on segments, with exact derivatives."""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy import sparse

from ocp import (
    OCP,
    Buffered,
    Data,
    Integrator,
    Optimality,
    compiled,
    derive,
    interpolate,
    symbol_kind,
)


@dataclass(frozen=True, eq=False)
class Paths:
    """The canonical flow integrated on every segment.

    Attributes:
        z: (x, costate) at every step, (S, M + 1, 2 nx).
        costs: running cost of every step, (S * M,).
    """

    z: np.ndarray
    costs: np.ndarray

    @property
    def ends(self) -> np.ndarray:
        """Z at the end of each segment, (S, 2 nx)."""
        return self.z[:, -1]

    @property
    def nodes(self) -> np.ndarray:
        """Z at every step of the whole horizon, (S M + 1, 2 nx)."""
        return np.vstack([self.z[:, :-1].reshape(-1, self.z.shape[2]), self.z[-1, -1]])


@dataclass(frozen=True, eq=False)
class Schedule:
    """Where in time and parameters a run integrates: S * M steps.

    Attributes:
        t0: initial time [s].
        duration: of the whole horizon [s], where it is not an unknown.
        fractions: step boundaries as fractions of the horizon, (S M + 1,).
        p_left: parameters at the start of each step, (S M, n_p).
        p_right: parameters at the end of each step, (S M, n_p).
        p_first: parameters at t0.
        p_last: parameters at the final time.
    """

    t0: float
    duration: float
    fractions: np.ndarray
    p_left: np.ndarray
    p_right: np.ndarray
    p_first: np.ndarray
    p_last: np.ndarray

    @classmethod
    def of(cls, ocp: OCP, data: Data, steps: int, share: float = 1.0) -> "Schedule":
        """Return the schedule of the first ``share`` of the horizon."""
        fractions = np.linspace(0.0, 1.0, steps + 1)
        left, right = data.values.on(share * fractions)
        return cls(
            t0=data.t0,
            duration=share * ocp.duration,
            fractions=fractions,
            p_left=left,
            p_right=right,
            p_first=data.values.at(0.0)[0],
            p_last=data.values.at(share)[0],
        )

    def reversed(self) -> "Schedule":
        """Return the same schedule from the end to the start: its steps go back in time."""
        return Schedule(
            t0=self.t0 + self.duration,
            duration=-self.duration,
            fractions=1.0 - self.fractions[::-1],
            p_left=self.p_right[::-1],
            p_right=self.p_left[::-1],
            p_first=self.p_last,
            p_last=self.p_first,
        )


@dataclass(frozen=True, eq=False)
class Shape:
    """How the unknowns are stacked: z of each segment's start, then mu, nu and the duration."""

    segments: int
    nx: int
    n_mu: int
    n_nu: int
    free_time: bool

    def join(self, z: np.ndarray, mu: np.ndarray, nu: np.ndarray, duration: float) -> np.ndarray:
        """Return the vector of unknowns."""
        return np.concatenate([z.ravel(), mu, nu, [duration] if self.free_time else []])

    def split(
        self, v: np.ndarray, duration: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """Return z (S, 2 nx), mu, nu and the duration, which is the given one where fixed."""
        z, mu, nu, rest = np.split(
            v, np.cumsum([2 * self.nx * self.segments, self.n_mu, self.n_nu])
        )
        return z.reshape(self.segments, -1), mu, nu, float(rest[0]) if self.free_time else duration


@dataclass(frozen=True, eq=False)
class Extremals:
    """Residual and Jacobian of the boundary value problem of a problem.

    Attributes:
        ocp: the problem.
        optimality: its minimum principle.
        shape: layout of the unknowns.
        steps: integration steps per segment, M.
        roll: (z, T, t0, fraction, share, p0, p1) of all steps -> z and cost after each.
        slopes: the same -> derivative of each step in z and in T.
        ends: (z, nu, t, p) -> end conditions, derivatives in z, nu, t.
        starts: (z, mu, t, p) -> start conditions, derivatives in z, mu.
        one: what ``roll`` and ``slopes`` do in each step.
    """

    ocp: OCP
    optimality: Optimality
    shape: Shape
    steps: int
    roll: Buffered
    slopes: Buffered
    ends: ca.Function
    starts: ca.Function
    one: tuple[ca.Function, ca.Function]

    @classmethod
    def of(
        cls, ocp: OCP, segments: int, steps: int, integrator: Integrator, *, fast: bool = False
    ) -> "Extremals":
        """Do all symbolic work; ``fast``: with the steps as machine code."""
        optimality = derive(ocp)
        starts, ends = _start_conditions(ocp, optimality), _end_conditions(ocp, optimality)
        shape = Shape(
            segments, ocp.model.nx, starts.size1_in(1), ends.size1_in(1), ocp.has_free_time
        )
        step, slope = _step(ocp, optimality, integrator)
        if fast:
            step, slope = compiled(step), compiled(slope)
        roll = Buffered(step.mapaccum(steps).map(segments))
        slopes = Buffered(slope.map(segments * steps))
        return cls(ocp, optimality, shape, steps, roll, slopes, ends, starts, (step, slope))

    def finer(self) -> "Extremals":
        """Return the same with half the step; nothing is derived again."""
        (step, slope), steps, segments = self.one, 2 * self.steps, self.shape.segments
        roll = Buffered(step.mapaccum(steps).map(segments))
        return replace(self, steps=steps, roll=roll, slopes=Buffered(slope.map(segments * steps)))

    # -- the boundary value problem --------------------------------------------------------

    def residual(
        self, v: np.ndarray, schedule: Schedule, x0: np.ndarray
    ) -> tuple[np.ndarray, Paths]:
        """Return start conditions, gaps between segments, end conditions; and the paths."""
        z, mu, nu, duration = self.shape.split(v, schedule.duration)
        paths = self.paths(z, schedule, duration)
        end = self.ends(paths.ends[-1], nu, schedule.t0 + duration, schedule.p_last)[0]
        parts = [self._start(z[0], mu, schedule, x0)[0], (paths.ends[:-1] - z[1:]).ravel(), end]
        return np.concatenate([np.array(part, dtype=float).ravel() for part in parts]), paths

    def paths(self, z: np.ndarray, schedule: Schedule, duration: float) -> Paths:
        """Integrate every segment from its start."""
        after, costs = self.roll(z.T, *self._inputs(schedule, duration))
        steps = after.T.reshape(self.shape.segments, self.steps, -1)
        return Paths(np.concatenate([z[:, None, :], steps], axis=1), costs.ravel())

    def step_slopes(
        self, paths: Paths, schedule: Schedule, duration: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivative of each step in z, (S M, 2 nx, 2 nx), and in T, (S M, 2 nx)."""
        before = paths.z[:, :-1].reshape(-1, paths.z.shape[2])
        in_z, in_time = self.slopes(before.T, *self._inputs(schedule, duration))
        return _blocks(in_z, before.shape[1]), in_time.T

    def segment_slopes(
        self, paths: Paths, schedule: Schedule, duration: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivative of each segment in its start, (S, 2 nx, 2 nx), and in T."""
        size = paths.z.shape[2]
        in_z, in_time = self.step_slopes(paths, schedule, duration)
        in_z = in_z.reshape(self.shape.segments, self.steps, size, size)
        in_time = in_time.reshape(self.shape.segments, self.steps, size)
        total, total_time = in_z[:, 0], in_time[:, 0]
        for i in range(1, self.steps):
            total_time = np.einsum("sij,sj->si", in_z[:, i], total_time) + in_time[:, i]
            total = in_z[:, i] @ total
        return total, total_time

    def jacobian(
        self,
        v: np.ndarray,
        paths: Paths,
        schedule: Schedule,
        x0: np.ndarray,
        slopes: tuple[np.ndarray, np.ndarray],
    ) -> sparse.csc_matrix:
        """Return the sparse Jacobian of the residual from the segments' slopes."""
        z, mu, nu, duration = self.shape.split(v, schedule.duration)
        s, size = self.shape.segments, 2 * self.shape.nx
        in_z, in_time = slopes
        t = schedule.t0 + duration
        _, end_z, end_nu, end_t = (
            np.array(a) for a in self.ends(paths.ends[-1], nu, t, schedule.p_last)
        )
        start_z, start_mu = self._start(z[0], mu, schedule, x0)[1:]
        blocks: list[list] = [[None] * (s + 3) for _ in range(s + 1)]
        blocks[0][0], blocks[0][s] = start_z, start_mu
        for k in range(s - 1):
            blocks[k + 1][k], blocks[k + 1][k + 1] = in_z[k], -np.eye(size)
            blocks[k + 1][s + 2] = in_time[k][:, None]
        blocks[s][s - 1], blocks[s][s + 1] = end_z @ in_z[-1], end_nu
        blocks[s][s + 2] = end_z @ in_time[-1][:, None] + end_t
        return _assemble(blocks, keep_time=self.shape.free_time)

    def trajectory(
        self, paths: Paths, schedule: Schedule, duration: float
    ) -> tuple[np.ndarray, ...]:
        """Return t, x, costate and u at every step of the horizon."""
        z, nx = paths.nodes, self.shape.nx
        t = schedule.t0 + schedule.fractions * duration
        p = np.vstack([schedule.p_left, schedule.p_last])
        control = self.optimality.control.map(len(t))
        u = control(z[:, :nx].T, z[:, nx:].T, t[None, :], p.T)
        return t, z[:, :nx], z[:, nx:], np.array(u).T

    def still(self, x0: np.ndarray, schedule: Schedule) -> tuple[np.ndarray, ...]:
        """Return a finite t, x, costate and u that stand still, where there is none to return."""
        ocp, nodes = self.ocp, schedule.fractions
        u = ocp.control_bounds.clip(np.zeros((len(nodes), ocp.model.nu)))
        x = np.tile(x0, (len(nodes), 1))
        return schedule.t0 + nodes * ocp.duration, x, np.zeros_like(x), u

    # -- pieces ----------------------------------------------------------------------------

    def _inputs(self, schedule: Schedule, duration: float) -> list:
        n = len(schedule.fractions) - 1
        constants = [np.full((1, n), duration), np.full((1, n), schedule.t0)]
        shares = [schedule.fractions[None, :-1], np.diff(schedule.fractions)[None, :]]
        return [*constants, *shares, schedule.p_left.T, schedule.p_right.T]

    def _start(
        self, z: np.ndarray, mu: np.ndarray, schedule: Schedule, x0: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if self.ocp.has_free_start:
            answer = self.starts(z, mu, schedule.t0, schedule.p_first)
            value, in_z, in_mu = (np.array(a) for a in answer)
            return value.ravel(), in_z, in_mu
        nx = self.shape.nx
        return z[:nx] - x0, np.eye(nx, 2 * nx), np.empty((nx, 0))


def _step(
    ocp: OCP, optimality: Optimality, integrator: Integrator
) -> tuple[ca.Function, ca.Function]:
    nx, n_p = ocp.model.nx, ocp.p.numel()
    kind = symbol_kind(optimality.flow)
    z, duration, t0 = kind.sym("z", 2 * nx), kind.sym("T"), kind.sym("t0")
    fraction, share = kind.sym("fraction"), kind.sym("share")
    p0, p1 = kind.sym("p0", n_p), kind.sym("p1", n_p)

    def rate(y, s):
        t, p = t0 + duration * (fraction + s * share), interpolate(p0, p1, s)
        u = optimality.control(y[:nx], y[nx : 2 * nx], t, p)
        cost = ocp.functions.running_cost(y[:nx], u, t, p)
        return duration * share * ca.vertcat(optimality.flow(y[: 2 * nx], t, p), cost)

    end = integrator(rate, ca.vertcat(z, 0), 0.0, 1.0)
    inputs = [z, duration, t0, fraction, share, p0, p1]
    names = ["z", "T", "t0", "fraction", "share", "p0", "p1"]
    derivatives = [ca.densify(ca.jacobian(end[: 2 * nx], v)) for v in (z, duration)]
    if kind is ca.SX:  # flow and cost share most of what they compute: half of a step's time
        end, derivatives = ca.cse([end])[0], ca.cse(derivatives)
    step = ca.Function("step", inputs, [end[: 2 * nx], end[2 * nx]], names, ["z_next", "cost"])
    return step, ca.Function("slope", inputs, derivatives, names, ["in_z", "in_T"])


def _start_conditions(ocp: OCP, optimality: Optimality) -> ca.Function:
    z = ca.SX.sym("z", 2 * ocp.model.nx)
    mu, t, p = (ca.SX.sym(n, optimality.start.sparsity_in(n)) for n in ("mu", "t", "p"))
    value = optimality.start(z[: ocp.model.nx], z[ocp.model.nx :], mu, t, p)
    derivatives = [ca.densify(ca.jacobian(value, v)) for v in (z, mu)]
    return ca.Function("starts", [z, mu, t, p], [value, *derivatives])


def _end_conditions(ocp: OCP, optimality: Optimality) -> ca.Function:
    kind = symbol_kind(optimality.end)
    z = kind.sym("z", 2 * ocp.model.nx)
    nu, t, p = (kind.sym(n, optimality.end.sparsity_in(n)) for n in ("nu", "t", "p"))
    value = optimality.end(z[: ocp.model.nx], z[ocp.model.nx :], nu, t, p)
    derivatives = [ca.densify(ca.jacobian(value, v)) for v in (z, nu, t)]
    return ca.Function("ends", [z, nu, t, p], [value, *derivatives])


def _blocks(horizontal: np.ndarray, size: int) -> np.ndarray:
    """Return CasADi's blocks side by side as (number, size, size)."""
    return horizontal.T.reshape(-1, size, size).transpose(0, 2, 1)


def _assemble(blocks: list[list], *, keep_time: bool) -> sparse.csc_matrix:
    """Stack the blocks, without columns that stand for no unknown."""
    rows = [row if keep_time else row[:-1] for row in blocks]
    used = [j for j in range(len(rows[0])) if any(r[j] is not None and r[j].shape[1] for r in rows)]
    columns = dict(zip(used, np.cumsum([0, *(_width(rows, j) for j in used)]), strict=False))
    entries, top = [], 0
    for row in rows:
        for j, left in columns.items():
            if row[j] is not None:
                i, k = np.nonzero(row[j])
                entries.append((row[j][i, k], top + i, left + k))
        top += next(len(block) for block in row if block is not None)
    data, i, k = (np.concatenate(part) for part in zip(*entries, strict=True))
    return sparse.csc_matrix((data, (i, k)), shape=(top, sum(_width(rows, j) for j in used)))


def _width(rows: list[list], j: int) -> int:
    return next(row[j].shape[1] for row in rows if row[j] is not None)
