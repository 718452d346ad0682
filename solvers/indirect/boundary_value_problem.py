"""The boundary value problem of the minimum principle on segments, with exact derivatives."""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy import sparse

from ocp import OCP, Integrator, MinimumPrinciple, minimum_principle
from ocp.internal import BufferedFunction, compiled
from solvers.indirect.canonical_flow import canonical_step, end_conditions, start_conditions
from solvers.indirect.newton_system import block_matrix
from solvers.indirect.shooting_segments import (
    CanonicalTrajectory,
    SegmentTrajectories,
    ShootingSchedule,
    UnknownsLayout,
)


@dataclass(frozen=True, eq=False)
class ExtremalProblem:
    """Residual and Jacobian of the boundary value problem of a problem.

    Attributes:
        ocp: the problem.
        optimality: its minimum principle.
        shape: layout of the unknowns.
        steps: integration steps per segment, M.
        roll: (z, T, t0, fraction, share, p0, p1) of all steps -> z and cost after each.
        slopes: the same -> derivative of each step in z and in T.
        ends: (z, nu, t, p) -> end conditions, derivatives in z, nu, t.
        starts: (z, mu, t, p, x0) -> start conditions, derivatives in z, mu.
        one: a step and its slope, of which ``roll`` and ``slopes`` are made.
    """

    ocp: OCP
    optimality: MinimumPrinciple
    shape: UnknownsLayout
    steps: int
    roll: BufferedFunction
    slopes: BufferedFunction
    ends: BufferedFunction
    starts: BufferedFunction
    one: tuple[ca.Function, ca.Function]

    @classmethod
    def of(
        cls, ocp: OCP, segments: int, steps: int, integrator: Integrator, *, fast: bool = False
    ) -> "ExtremalProblem":
        """Do all symbolic work; ``fast``: with the steps as machine code."""
        optimality = minimum_principle(ocp)
        starts, ends = start_conditions(ocp, optimality), end_conditions(ocp, optimality)
        shape = UnknownsLayout(
            segments, ocp.model.nx, starts.size1_in(1), ends.size1_in(1), ocp.has_free_time
        )
        step, slope = canonical_step(ocp, optimality, integrator)
        if fast:
            step, slope = compiled(step), compiled(slope)
        roll = BufferedFunction(step.mapaccum(steps).map(segments))
        slopes = BufferedFunction(slope.map(segments * steps))
        return cls(
            ocp=ocp,
            optimality=optimality,
            shape=shape,
            steps=steps,
            roll=roll,
            slopes=slopes,
            ends=BufferedFunction(ends),
            starts=BufferedFunction(starts),
            one=(step, slope),
        )

    def finer(self) -> "ExtremalProblem":
        """Return the same with half the step; nothing is derived again."""
        (step, slope), steps, segments = self.one, 2 * self.steps, self.shape.segments
        roll = BufferedFunction(step.mapaccum(steps).map(segments))
        return replace(
            self, steps=steps, roll=roll, slopes=BufferedFunction(slope.map(segments * steps))
        )

    # -- the boundary value problem --------------------------------------------------------

    def residual(
        self, v: np.ndarray, schedule: ShootingSchedule, x0: np.ndarray
    ) -> tuple[np.ndarray, SegmentTrajectories]:
        """Return start conditions, defects between segments, end conditions; and the paths."""
        z, mu, nu, duration = self.shape.split(v, schedule.duration)
        paths = self.paths(z, schedule, duration)
        end = self.ends(paths.ends[-1], nu, schedule.t0 + duration, schedule.p_last)[0]
        parts = [self._start(z[0], mu, schedule, x0)[0], (paths.ends[:-1] - z[1:]).ravel(), end]
        return np.concatenate([part.ravel() for part in parts]), paths

    def paths(
        self, z: np.ndarray, schedule: ShootingSchedule, duration: float
    ) -> SegmentTrajectories:
        """Integrate every segment from its start."""
        after, costs = self.roll(z.T, *self._inputs(schedule, duration))
        steps = after.T.reshape(self.shape.segments, self.steps, -1)
        return SegmentTrajectories(np.concatenate([z[:, None, :], steps], axis=1), costs.ravel())

    def step_slopes(
        self, paths: SegmentTrajectories, schedule: ShootingSchedule, duration: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivative of each step in z, (S M, 2 nx, 2 nx), and in T, (S M, 2 nx)."""
        before = paths.z[:, :-1].reshape(-1, paths.z.shape[2])
        in_z, in_time = self.slopes(before.T, *self._inputs(schedule, duration))
        return _blocks(in_z, before.shape[1]), in_time.T

    def segment_slopes(
        self, paths: SegmentTrajectories, schedule: ShootingSchedule, duration: float
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
        paths: SegmentTrajectories,
        schedule: ShootingSchedule,
        x0: np.ndarray,
        slopes: tuple[np.ndarray, np.ndarray],
    ) -> sparse.csc_matrix:
        """Return the sparse Jacobian of the residual from the segments' slopes."""
        z, mu, nu, duration = self.shape.split(v, schedule.duration)
        s, size = self.shape.segments, 2 * self.shape.nx
        in_z, in_time = slopes
        t = schedule.t0 + duration
        _, end_z, end_nu, end_t = self.ends(paths.ends[-1], nu, t, schedule.p_last)
        start_z, start_mu = self._start(z[0], mu, schedule, x0)[1:]
        blocks: list[list] = [[None] * (s + 3) for _ in range(s + 1)]
        blocks[0][0], blocks[0][s] = start_z, start_mu
        for k in range(s - 1):
            blocks[k + 1][k], blocks[k + 1][k + 1] = in_z[k], -np.eye(size)
            blocks[k + 1][s + 2] = in_time[k][:, None]
        blocks[s][s - 1], blocks[s][s + 1] = end_z @ in_z[-1], end_nu
        blocks[s][s + 2] = end_z @ in_time[-1][:, None] + end_t
        return block_matrix(blocks if self.shape.free_time else [row[:-1] for row in blocks])

    def trajectory(
        self, paths: SegmentTrajectories, schedule: ShootingSchedule, duration: float
    ) -> CanonicalTrajectory:
        """Return the trajectory at every step of the horizon."""
        z, nx = paths.nodes, self.shape.nx
        t = schedule.t0 + schedule.fractions * duration
        p = np.vstack([schedule.p_left, schedule.p_last])
        control = self.optimality.control.map(len(t))
        u = control(z[:, :nx].T, z[:, nx:].T, t[None, :], p.T)
        return CanonicalTrajectory(t, z[:, :nx], z[:, nx:], np.array(u).T)

    def still(self, x0: np.ndarray, schedule: ShootingSchedule) -> CanonicalTrajectory:
        """Return a constant trajectory, which is finite: where a run has found none."""
        ocp, nodes = self.ocp, schedule.fractions
        u = ocp.control_bounds.clip(np.zeros((len(nodes), ocp.model.nu)))
        x = np.tile(x0, (len(nodes), 1))
        t = schedule.t0 + nodes * ocp.duration
        return CanonicalTrajectory(t, x, np.zeros_like(x), u)

    # -- pieces ----------------------------------------------------------------------------

    def _inputs(self, schedule: ShootingSchedule, duration: float) -> list:
        n = len(schedule.fractions) - 1
        constants = [np.full((1, n), duration), np.full((1, n), schedule.t0)]
        shares = [schedule.fractions[None, :-1], np.diff(schedule.fractions)[None, :]]
        return [*constants, *shares, schedule.p_left.T, schedule.p_right.T]

    def _start(
        self, z: np.ndarray, mu: np.ndarray, schedule: ShootingSchedule, x0: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if self.ocp.has_free_start:
            value, in_z, in_mu = self.starts(z, mu, schedule.t0, schedule.p_first, x0)
            return value.ravel(), in_z, in_mu
        nx = self.shape.nx
        return z[:nx] - x0, np.eye(nx, 2 * nx), np.empty((nx, 0))


def _blocks(horizontal: np.ndarray, size: int) -> np.ndarray:
    """Return CasADi's blocks side by side as (number, size, size)."""
    return horizontal.T.reshape(-1, size, size).transpose(0, 2, 1)
