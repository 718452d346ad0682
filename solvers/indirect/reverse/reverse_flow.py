"""The canonical flow backwards, from end configurations whose costate is known."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp import OCP, Integrator
from solvers.indirect.boundary_value_problem import ExtremalProblem
from solvers.indirect.shooting_segments import SegmentTrajectories, ShootingSchedule
from solvers.tabular.columns import Columns


@dataclass(frozen=True, eq=False)
class Starts:
    """Where reverse integrations arrive at t0, a row each; not finite where one blew up.

    Attributes:
        x: states (K, nx).
        costate: (K, nx).
        cost: of the whole motion (K,).
    """

    x: np.ndarray
    costate: np.ndarray
    cost: np.ndarray


@dataclass(frozen=True, eq=False)
class ReverseFlow:
    r"""Extremals of a problem by their end: :math:`\psi(t_1) = \varphi_x(x(t_1))`.

    Source: thesis (3.53), (3.54) and (3.56), (3.57).

    Attributes:
        extremals: the problem's canonical flow, as one segment.
        final: (x, t, p) -> z = (x, phi_x) and its derivative in x.
        sweep: (x1, T, t1, shares, p before, p after) -> z at t0 and cost, for many x1.
    """

    extremals: ExtremalProblem
    final: ca.Function
    sweep: Columns

    @classmethod
    def of(cls, ocp: OCP, steps: int, integrator: Integrator) -> "ReverseFlow":
        """Do all symbolic work."""
        extremals = ExtremalProblem.of(ocp, 1, steps, integrator)
        final = _final(ocp)
        return cls(extremals, final, Columns(_sweep(extremals, final), 1))

    def starts(self, ends: np.ndarray, schedule: ShootingSchedule) -> Starts:
        """Integrate back from many ends (K, nx) at once.

        Args:
            ends: configurations at t1.
            schedule: of the run, forwards.
        """
        back, nx = schedule.reversed(), ends.shape[1]
        common = [
            np.array([back.duration]),
            np.array([back.t0]),
            back.fractions,
            back.p_left,
            back.p_right,
            back.p_first,
            back.p_last,
        ]
        rows = self.sweep([ends], common)
        return Starts(rows[:, :nx], rows[:, nx : 2 * nx], rows[:, 2 * nx])

    def path(self, end: np.ndarray, schedule: ShootingSchedule) -> SegmentTrajectories:
        """Integrate back from one end (nx,); the paths are in reversed time."""
        back = schedule.reversed()
        z, _ = self.final(end, back.t0, back.p_first)
        return self.extremals.paths(np.array(z).T, back, back.duration)

    def slope(
        self, paths: SegmentTrajectories, schedule: ShootingSchedule, directions: np.ndarray
    ) -> np.ndarray:
        """Return the derivative of z(t0) along directions (nx, d) of the end, (2 nx, d)."""
        back, nx = schedule.reversed(), len(directions)
        end = paths.z[0, 0, :nx]
        moved = np.array(self.final(end, back.t0, back.p_first)[1]) @ directions
        in_z, _ = self.extremals.step_slopes(paths, back, back.duration)
        for step in in_z:
            moved = step @ moved
        return moved


def _final(ocp: OCP) -> ca.Function:
    m = ocp.model
    z = ca.vertcat(m.x, ca.gradient(ca.SX(ocp.terminal_cost), m.x))
    slope = ca.densify(ca.jacobian(z, m.x))
    return ca.Function("final", [m.x, m.t, ocp.p], [ca.densify(z), slope])


def _sweep(extremals: ExtremalProblem, final: ca.Function) -> ca.Function:
    ocp, steps = extremals.ocp, extremals.steps
    n_p = ocp.p.numel()
    end, duration, t1 = ca.MX.sym("end", ocp.model.nx), ca.MX.sym("T"), ca.MX.sym("t1")
    fractions = ca.MX.sym("fractions", 1, steps + 1)
    left, right = ca.MX.sym("left", n_p, steps), ca.MX.sym("right", n_p, steps)
    first, last = ca.MX.sym("first", n_p), ca.MX.sym("last", n_p)
    z, _ = final(end, t1, first)
    shares = [fractions[:-1], fractions[1:] - fractions[:-1]]
    constant = [ca.repmat(duration, 1, steps), ca.repmat(t1, 1, steps)]
    after, costs = extremals.roll.function(z, *constant, *shares, left, right)
    start = after[:, -1]
    # Backwards in time every running cost comes out negative.
    cost = ocp.functions.terminal_cost(end, t1, first) - ca.sum2(costs)
    inputs = [end, duration, t1, fractions, left, right, first, last]
    return ca.Function("sweep", inputs, [ca.vertcat(start, cost)])
