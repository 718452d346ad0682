"""Indirect multiple shooting over arcs: every switch is an unknown, its condition an equation."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp import Solution, Status
from solvers.certify.arc_conditions import ArcConditions
from solvers.indirect.newton_iteration import NewtonResult, newton


@dataclass(frozen=True, eq=False)
class ArcShooting:
    """Newton's method on the conditions of arcs.

    Unknowns are states and costates at the nodes, the durations of the arcs, and multipliers ν of
    the terminal equations.

    Attributes:
        conditions: with the arcs, and the solution that the first iterate comes from.
        nodes: on each arc.
        steps: of RK4 from node to node, even.
    """

    conditions: ArcConditions
    nodes: int = 4
    steps: int = 32

    @property
    def start(self) -> Solution:
        """Where the first iterate comes from."""
        return self.conditions.start

    @property
    def count(self) -> int:
        """How many arcs there are."""
        return len(self.conditions.arcs)

    # -- the flow ---------------------------------------------------------------------

    @cached_property
    def _flows(self) -> list[ca.Function]:
        """(z, t, h) -> states and costates after each of the steps of length h."""
        return [self._flow(rate_of) for rate_of in self.conditions.rates]

    def _flow(self, rate_of: ca.Function) -> ca.Function:
        m = self.start.problem.model
        z, t, h = ca.SX.sym("z", 2 * m.nx), ca.SX.sym("t"), ca.SX.sym("h")
        k1 = rate_of(z, t)
        k2 = rate_of(z + h / 2.0 * k1, t + h / 2.0)
        k3 = rate_of(z + h / 2.0 * k2, t + h / 2.0)
        k4 = rate_of(z + h * k3, t + h)
        step = ca.Function("step", [z, t, h], [z + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)])
        begin, clock, width = ca.MX.sym("z", 2 * m.nx), ca.MX.sym("t"), ca.MX.sym("h")
        times = clock + width * ca.DM(np.arange(self.steps)).T
        run = step.mapaccum("run", self.steps)
        return ca.Function(
            "flow", [begin, clock, width], [run(begin, times, ca.repmat(width, 1, self.steps))]
        )

    def trajectory(self, w: np.ndarray) -> Solution:
        """Return what the unknowns say, with a polynomial of degree two over every two steps."""
        ocp = self.start.problem
        m, laws = ocp.model, [self.conditions.function([u]) for u in self.conditions.controls]
        size, total = 2 * m.nx, self.count * self.nodes
        z = w[: size * total].reshape(total, size).T
        lengths = w[size * total : size * total + self.count]
        h = np.repeat(lengths / (self.nodes * self.steps), self.nodes)
        begins = self.start.data.t0 + np.append(0.0, np.cumsum(h * self.steps))
        rows, controls, part = [], [], z
        for k, begin in enumerate(begins[:-1]):
            i = k // self.nodes
            run = np.array(self._flows[i](z[:, k], begin, h[k]))
            part = np.column_stack([z[:, k], run])
            times = begin + h[k] * np.arange(self.steps + 1)
            u = np.array(laws[i].map(self.steps + 1)(part, times[None]))
            middle = 2.0 * u[:, 1::2] - (u[:, :-1:2] + u[:, 2::2]) / 2.0
            coefficients = np.stack([u[:, :-1:2], middle, u[:, 2::2]], axis=2)
            controls.append(ocp.control_bounds.clip(coefficients.transpose(1, 2, 0)))
            rows.append(np.column_stack([times, part.T])[:-1])
        last = np.concatenate([[begins[-1]], part[:, -1]])
        table = np.vstack([*rows, last])
        return self.start.with_(
            solver=f"indirect shooting on {self.count} arcs",
            t=table[:, 0],
            x=table[:, 1 : 1 + m.nx],
            costate=table[:, 1 + m.nx :],
            u=np.concatenate(controls).reshape(-1, m.nu),
            control_kind="polynomial",
            breaks=np.arange(0, len(table), 2),
            status=Status.SOLVED,
            message="",
        )

    def wrong_signs(self, trajectory: Solution) -> float:
        """Return the largest law multiplier of a wrong sign, relative to 1 + the largest of all."""
        worst, largest, pieces = 0.0, 0.0, self.nodes * self.steps
        for i, values in enumerate(self.conditions.law_multipliers):
            at = slice(i * pieces, (i + 1) * pieces + 1)
            z = np.hstack([trajectory.x[at], trajectory.costate[at]]).T
            values_along = np.array(values.map(z.shape[1])(z, trajectory.t[at][None]))
            worst = max(worst, float(values_along.max(initial=0.0)))
            largest = max(largest, float(np.abs(values_along).max(initial=0.0)))
        return worst / (1.0 + largest)

    # -- the equations ----------------------------------------------------------------

    @cached_property
    def system(self) -> tuple[ca.Function, ca.Function]:
        """Residual and its Jacobian."""
        count, conditions, nx = self.count, self.conditions, self.start.problem.model.nx
        total, psi = count * self.nodes, conditions.psi
        w = ca.MX.sym("w", 2 * nx * total + count + psi.numel())
        z = ca.reshape(w[: 2 * nx * total], 2 * nx, total)
        lengths, nu = w[2 * nx * total : 2 * nx * total + count], w[2 * nx * total + count :]
        t, after, residual = ca.MX(self.start.data.t0), z[:, 0], [z[:nx, 0] - self.start.data.x0]
        for i in range(count):
            h = lengths[i] / (self.nodes * self.steps)
            for k in range(self.nodes):
                node = i * self.nodes + k
                residual += [after - z[:, node]] if node else []
                after = self._flows[i](z[:, node], t, h)[:, -1]
                t += h * self.steps
            if i + 1 < count:
                residual.append(conditions.junctions[i](after, t))
        residual.append(conditions.end(after, t, nu, lengths))
        r = ca.vertcat(*residual)
        return ca.Function("r", [w], [r]), ca.Function("j", [w], [ca.jacobian(r, w)])

    def guess(self) -> np.ndarray:
        """The unknowns as the start has them; ν by least squares."""
        start, ocp = self.start, self.start.problem
        edges = np.array([arc.start for arc in self.conditions.arcs] + [1.0])
        inner = np.arange(self.nodes) / self.nodes
        fractions = (edges[:-1, None] + np.diff(edges)[:, None] * inner).ravel()
        times = start.t[0] + fractions * start.duration
        z = np.hstack([start.state(times), start.costate_at(times)])
        z[0, : ocp.model.nx] = start.data.x0
        last = np.concatenate([start.x[-1], start.costate[-2]])
        by_cost, by_end = (np.array(v) for v in self.conditions.ends.call([last, start.t[-1]]))
        defect = start.costate[-2] - by_cost.ravel()
        nu = np.linalg.lstsq(by_end.T, defect, rcond=None)[0] if by_end.size else np.empty(0)
        return np.concatenate([z.ravel(), start.duration * np.diff(edges), nu])

    def solve(self, guess: np.ndarray, tolerance: float) -> NewtonResult:
        """Newton's method, damped."""
        value, slope = self.system

        def residual(w: np.ndarray) -> tuple[np.ndarray, None]:
            return np.array(value(w)).ravel(), None

        def linearise(w: np.ndarray, _: None):
            jacobian = np.array(slope(w))
            return lambda r: np.linalg.lstsq(jacobian, r, rcond=None)[0]

        return newton(residual, linearise, guess, tolerance=tolerance, max_steps=50, damped=True)
