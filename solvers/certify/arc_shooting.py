"""Indirect multiple shooting over arcs: every switch is an unknown, its condition an equation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp import Signal, Solution, Status, hamiltonian
from solvers.certify.arcs import Arc, NoArcsError
from solvers.indirect.newton import NewtonResult, newton


@dataclass(frozen=True, eq=False)
class ArcShooting:
    r"""The minimum principle on arcs, each with its own control.

    On arc i the laws decide some controls, and H_u = 0 the others, so that u = u_i(x, λ, t) and

    .. math::

        \dot x = f(x, u_i), \quad \dot\lambda = -\partial_x \, H(x, u_i(x, \lambda, t), \lambda, t)

    where the derivative goes through the laws: that is the multiplier of what is active. Unknowns
    are states and costates at the nodes, the durations of the arcs, and multipliers ν of the
    terminal equations ψ. Where control j enters or leaves a law

    .. math:: H_{u_j} = 0 \quad \text{with the control as the law has it,}

    at the end ψ = 0, λ = φ_x + ψ_x'ν, and either the durations make up the horizon or
    H + φ_t + ν'ψ_t = 0. Source: [Bryson & Ho 1975, 3.8 and 3.9].

    Attributes:
        start: where arcs and first guess come from, with costates.
        arcs: in order.
        nodes: on each arc.
        steps: of RK4 from node to node, even.
    """

    start: Solution
    arcs: tuple[Arc, ...]
    nodes: int = 4
    steps: int = 32

    def __post_init__(self) -> None:
        """Refuse what the equations do not say."""
        ocp = self.start.problem
        if any(isinstance(entry, Signal) for entry in ocp.parameters):
            raise NoArcsError("signals are not looked at")
        if ocp.has_free_start:
            raise NoArcsError("the start is free")
        if not all(c.is_equation for c in ocp.at("terminal")):
            raise NoArcsError("an inequality at the end")
        self._controls  # noqa: B018 - refuses its own
        self._junctions  # noqa: B018 - refuses its own

    # -- symbols ----------------------------------------------------------------------

    @cached_property
    def _numbers(self) -> np.ndarray:
        return self.start.data.values.at(0.0)[0]

    @property
    def _z(self) -> ca.SX:
        """State and costate."""
        return ca.vertcat(self.start.problem.model.x, self._costate)

    @cached_property
    def _costate(self) -> ca.SX:
        return hamiltonian(self.start.problem).expressions.costate

    @cached_property
    def _hamiltonian(self) -> ca.SX:
        ocp = self.start.problem
        return ocp.running_cost + ca.dot(self._costate, ocp.model.f)

    @cached_property
    def _controls(self) -> list[ca.SX]:
        """u_i(x, λ, t) of each arc."""
        return [self._control(arc) for arc in self.arcs]

    def _control(self, arc: Arc) -> ca.SX:
        m = self.start.problem.model
        symbols, u = ca.vertsplit(m.u), m.u
        for symbol, law in zip(symbols, arc.laws, strict=True):
            u = ca.substitute(u, symbol, law.value) if law else u
        free = [s for s, law in zip(symbols, arc.laws, strict=True) if law is None]
        if not free:
            return u
        chosen = ca.vertcat(*free)
        slope = ca.gradient(ca.substitute(self._hamiltonian, m.u, u), chosen)
        curvature = ca.jacobian(slope, chosen)
        if ca.depends_on(curvature, chosen) or ca.sprank(curvature) < len(free):
            names = ", ".join(str(s) for s in free)
            raise NoArcsError(f"H is not quadratic in {names} where no bound is met")
        best = -ca.solve(curvature, ca.substitute(slope, chosen, ca.SX.zeros(len(free))))
        return ca.substitute(u, chosen, best)

    @cached_property
    def _junctions(self) -> list[ca.SX]:
        """H_u of the control that changes its law, from arc to arc."""
        m, found = self.start.problem.model, []
        slope = ca.gradient(self._hamiltonian, m.u)
        for k, (one, other) in enumerate(zip(self.arcs, self.arcs[1:], strict=False)):
            pairs = zip(one.names, other.names, strict=True)
            changed = [j for j, (a, b) in enumerate(pairs) if a != b]
            if len(changed) != 1:
                raise NoArcsError("two controls switch at once")
            (j,) = changed
            laws = one.laws[j], other.laws[j]
            if all(laws) and any(law.row is not None for law in laws if law):
                raise NoArcsError("a control goes from a bound right to a path constraint")
            bound = self._controls[k if laws[0] else k + 1]
            found.append(ca.substitute(slope[j], m.u, bound))
        return found

    def _function(self, expressions: Sequence[ca.SX]) -> ca.Function:
        ocp = self.start.problem
        values = ca.substitute(list(expressions), [ocp.p], [ca.SX(self._numbers)])
        return ca.Function("at", [self._z, ocp.model.t], values)

    # -- the flow ---------------------------------------------------------------------

    @cached_property
    def _flows(self) -> list[ca.Function]:
        """(z, t, h) -> states and costates after each of the steps of length h."""
        return [self._flow(u) for u in self._controls]

    def _flow(self, u: ca.SX) -> ca.Function:
        m = self.start.problem.model
        own = ca.substitute(self._hamiltonian, m.u, u)
        rate_of = self._function([ca.vertcat(ca.substitute(m.f, m.u, u), -ca.gradient(own, m.x))])
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
        m, count = ocp.model, len(self.arcs)
        z, lengths, _ = self._split(w)
        h = np.repeat(lengths / (self.nodes * self.steps), self.nodes)
        begins = self.start.data.t0 + np.append(0.0, np.cumsum(h * self.steps))
        rows, controls, part = [], [], z
        for k, begin in enumerate(begins[:-1]):
            i = k // self.nodes
            run = np.array(self._flows[i](z[:, k], begin, h[k]))
            part = np.column_stack([z[:, k], run])
            times = begin + h[k] * np.arange(self.steps + 1)
            u = np.array(self._function([self._controls[i]]).map(self.steps + 1)(part, times[None]))
            middle = 2.0 * u[:, 1::2] - (u[:, :-1:2] + u[:, 2::2]) / 2.0
            coefficients = np.stack([u[:, :-1:2], middle, u[:, 2::2]], axis=2)
            controls.append(ocp.control_bounds.clip(coefficients.transpose(1, 2, 0)))
            rows.append(np.column_stack([times, part.T])[:-1])
        last = np.concatenate([[begins[-1]], part[:, -1]])
        table = np.vstack([*rows, last])
        return self.start.with_(
            solver=f"indirect shooting on {count} arcs",
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
        """By how much H_u pulls a control off a law that holds it, relative to 1 + abs(H_u)."""
        worst, largest, pieces = 0.0, 0.0, self.nodes * self.steps
        slope = ca.gradient(self._hamiltonian, self.start.problem.model.u)
        for i, arc in enumerate(self.arcs):
            at = slice(i * pieces, (i + 1) * pieces + 1)
            z = np.hstack([trajectory.x[at], trajectory.costate[at]]).T
            pushes = [
                law.push * s for law, s in zip(arc.laws, ca.vertsplit(slope), strict=True) if law
            ]
            bound = [
                ca.substitute(p, self.start.problem.model.u, self._controls[i]) for p in pushes
            ]
            values = self._function([ca.vertcat(ca.SX(0, 1), *bound)])
            pulled = np.array(values.map(z.shape[1])(z, trajectory.t[at][None]))
            worst = max(worst, float(pulled.max(initial=0.0)))
            largest = max(largest, float(np.abs(pulled).max(initial=0.0)))
        return worst / (1.0 + largest)

    def _split(self, w: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nodes (2 nx, total), durations, ν."""
        size, count = 2 * self.start.problem.model.nx, len(self.arcs)
        total = size * count * self.nodes
        return w[:total].reshape(-1, size).T, w[total : total + count], w[total + count :]

    # -- the equations ----------------------------------------------------------------

    @cached_property
    def system(self) -> tuple[ca.Function, ca.Function]:
        """Residual and its Jacobian."""
        ocp, count = self.start.problem, len(self.arcs)
        nx, total = ocp.model.nx, len(self.arcs) * self.nodes
        psi = ca.vertcat(
            ca.SX(0, 1), *[c.expression - ca.DM(np.asarray(c.lower)) for c in ocp.at("terminal")]
        )
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
                residual.append(self._function([self._junctions[i]])(after, t))
        residual.append(self._end(psi)(after, t, nu, lengths))
        r = ca.vertcat(*residual)
        return ca.Function("r", [w], [r]), ca.Function("j", [w], [ca.jacobian(r, w)])

    def _end(self, psi: ca.SX) -> ca.Function:
        """What holds at the final time."""
        ocp, lengths = self.start.problem, ca.SX.sym("lengths", len(self.arcs))
        m, nu = ocp.model, ca.SX.sym("nu", psi.numel())
        end = ca.SX(ocp.terminal_cost) + ca.dot(nu, psi)
        if ocp.has_free_time:
            value = ca.substitute(self._hamiltonian, m.u, self._controls[-1])
            last = value + ca.gradient(end, m.t)
        else:
            last = ca.sum1(lengths) - ocp.duration
        rows = ca.vertcat(psi, self._costate - ca.gradient(end, m.x), last)
        rows = ca.substitute(rows, ocp.p, ca.SX(self._numbers))
        return ca.Function("end", [self._z, m.t, nu, lengths], [rows])

    def guess(self) -> np.ndarray:
        """The unknowns as the start has them; ν by least squares."""
        start, ocp = self.start, self.start.problem
        edges = np.array([arc.start for arc in self.arcs] + [1.0])
        inner = np.arange(self.nodes) / self.nodes
        fractions = (edges[:-1, None] + np.diff(edges)[:, None] * inner).ravel()
        times = start.t[0] + fractions * start.duration
        z = np.hstack([start.state(times), start.costate_at(times)])
        z[0, : ocp.model.nx] = start.data.x0
        m = ocp.model
        psi = ca.vertcat(ca.SX(0, 1), *[c.expression for c in ocp.at("terminal")])
        ends = [ca.gradient(ca.SX(ocp.terminal_cost), m.x), ca.jacobian(psi, m.x)]
        last = np.concatenate([start.x[-1], start.costate[-2]])
        by_cost, by_end = (np.array(v) for v in self._function(ends).call([last, start.t[-1]]))
        gap = start.costate[-2] - by_cost.ravel()
        nu = np.linalg.lstsq(by_end.T, gap, rcond=None)[0] if psi.numel() else np.empty(0)
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
