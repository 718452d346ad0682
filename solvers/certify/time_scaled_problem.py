"""A problem on arcs whose durations are unknowns, with the controls that the arcs' laws decide."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint, FreeTime, Guess, Model, Signal, Solution
from solvers.certify.control_arcs import Arc, NoArcsError

# Samples of the guess on each arc.
_SAMPLES = 20


@dataclass(frozen=True, eq=False)
class TimeScaledProblem:
    r"""The same problem, each arc of length one.

    .. math::

        \frac{dx}{ds} = d_i f(x, u_i(x, t)), \quad \frac{dt}{ds} = d_i, \quad
        \frac{dd}{ds} = 0, \qquad i - 1 \le s < i

    where u_i follows the laws of arc i. With d_i among the unknowns every switch is met
    exactly, so that one-step methods keep their order. A row of the path constraints
    whose law decides a control is not asked again there.

    Attributes:
        start: where arcs and first guess come from: the original problem.
        arcs: in order.
    """

    start: Solution
    arcs: tuple[Arc, ...]

    def __post_init__(self) -> None:
        """Refuse signals, which are sampled over the horizon."""
        if self.start.problem.moving:
            raise NoArcsError("signals are not looked at")

    @cached_property
    def _now(self) -> ca.SX:
        """Which arc it is: a column of zeros and a one."""
        return ca.SX.sym("arc", len(self.arcs))

    @cached_property
    def _durations(self) -> ca.SX:
        return ca.SX.sym("duration", len(self.arcs))

    @cached_property
    def _control(self) -> ca.SX:
        """The controls as the laws have them."""
        u = ca.vertsplit(self.start.problem.model.u)
        return ca.vertcat(*[self._decided(j, symbol) for j, symbol in enumerate(u)])

    def _decided(self, j: int, symbol: ca.SX) -> ca.SX:
        laws = [arc.laws[j] for arc in self.arcs]
        return ca.dot(self._now, ca.vertcat(*[law.value if law else symbol for law in laws]))

    @property
    def lengths(self) -> np.ndarray:
        """First guess of the durations [s]."""
        return self.start.duration * np.array([arc.end - arc.start for arc in self.arcs])

    @cached_property
    def ocp(self) -> OCP:
        """The scaled problem; its states are x, the time, and the durations."""
        ocp, count = self.start.problem, len(self.arcs)
        m, pace, duration = ocp.model, ca.dot(self._now, self._durations), ocp.horizon
        u = self._control
        running = ca.substitute(ca.SX(ocp.running_cost), m.u, u)
        rate = ca.substitute(m.f, m.u, u)
        time = ocp.time_box if isinstance(duration, FreeTime) else Box([duration], [duration])
        data, box = self.start.data, ocp.state_bounds
        later = Box.unbounded(1 + count)
        begin = np.append(data.x0, data.t0)
        given = np.flatnonzero(~ocp.start_is_free)
        own = (self._fixed("start", m.x[given.tolist(), :], data.x0[given]),) if given.size else ()
        states = ca.vertcat(m.x, m.t, self._durations)
        arc = Signal(self._name("arc"), self._now, np.vstack([np.eye(count), np.eye(count)[-1]]))
        return OCP(
            name=f"{ocp.name}, on {count} arcs",
            model=Model(
                name=f"{m.name}, time scaled",
                x=states,
                u=m.u,
                f=ca.vertcat(pace * rate, pace, ca.SX.zeros(count)),
            ),
            x0=np.concatenate([begin, self.lengths]),
            horizon=float(count),
            running_cost=pace * running + self._pinned,
            terminal_cost=ocp.terminal_cost,
            control_bounds=ocp.control_bounds,
            state_bounds=Box(
                np.concatenate([np.asarray(box.lower), [-np.inf], np.zeros(count)]),
                np.concatenate([np.asarray(box.upper), np.full(1 + count, np.inf)]),
            ),
            start_bounds=ocp.start_bounds & later,
            constraints=(
                *own,
                self._fixed("begin", m.t, data.t0),
                *self._path(),
                *(c for c in ocp.constraints if c.at != "path"),
                Constraint(
                    self._name("horizon"),
                    m.t,
                    data.t0 + np.asarray(time.lower),
                    data.t0 + np.asarray(time.upper),
                    at="terminal",
                ),
            ),
            parameters=(*ocp.parameters, arc),
            smoothness=ocp.smoothness,
        )

    def _fixed(self, name: str, expression: ca.SX, value: np.ndarray | float) -> Constraint:
        return Constraint(self._name(name), expression, value, value, at="initial")

    def _name(self, name: str) -> str:
        """Return a name that the problem does not use itself."""
        ocp = self.start.problem
        taken = {entry.name for entry in (*ocp.constraints, *ocp.parameters)}
        while name in taken:
            name = f"{name} of the arcs"
        return name

    @property
    def _pinned(self) -> ca.SX:
        """A cost that fixes the controls that laws replace: nothing else depends on them."""
        ocp, cost = self.start.problem, ca.SX(0.0)
        box = ocp.control_bounds
        for j, symbol in enumerate(ca.vertsplit(ocp.model.u)):
            decided = [float(arc.laws[j] is not None) for arc in self.arcs]
            rest = _between(*(float(np.asarray(b)[j]) for b in (box.lower, box.upper)))
            cost += ca.dot(self._now, ca.DM(decided)) * (symbol - rest) ** 2
        return cost

    def _path(self) -> Sequence[Constraint]:
        ocp, row, found = self.start.problem, 0, []
        for c in ocp.at("path"):
            expression = ca.substitute(c.expression, ocp.model.u, self._control)
            parts = []
            for e, low, high in zip(
                ca.vertsplit(expression), np.asarray(c.lower), np.asarray(c.upper), strict=True
            ):
                kept = [any(law and law.row == row for law in arc.laws) for arc in self.arcs]
                share = ca.dot(self._now, ca.DM(np.array(kept, dtype=float)))
                part = (1.0 - share) * e + share * _between(float(low), float(high))
                parts += [] if all(kept) else [(part, low, high)]
                row += 1
            if parts:
                rows, lower, upper = zip(*parts, strict=True)
                found.append(Constraint(c.name, ca.vertcat(*rows), lower, upper))
        return found

    def trajectory(self, answer: Solution) -> Solution:
        """Return an answer to the scaled problem, controls held, as one to the original.

        Time and start are among its states, which a solver meets to rounding: here they are exact.
        """
        ocp, count = self.start.problem, len(self.arcs)
        m, each = ocp.model, (len(answer.t) - 1) // count
        controls = ca.Function("u", [m.x, m.t, m.u, ocp.p, self._now], [self._control])
        arc = np.repeat(np.eye(count), each, axis=0)
        p = np.tile(self.start.data.values.at(0.0), (len(arc), 1))
        x, t = answer.x[:, : m.nx].copy(), answer.x[:, m.nx].copy()
        t[0] = self.start.data.t0
        x[0] = ocp.start_of(self.start.data.x0, x[0])
        ends = [
            np.array(
                controls.map(len(arc))(*[v.T for v in (x[k], t[k][:, None], answer.u, p, arc)])
            )
            for k in (slice(0, -1), slice(1, None))
        ]
        return self.start.with_(
            solver=f"direct multiple shooting on {count} arcs",
            t=t,
            x=x,
            costate=answer.costate[:, : m.nx],
            u=np.stack(ends, axis=2).transpose(1, 2, 0).reshape(-1, m.nu),
            control_kind="polynomial",
            breaks=np.arange(len(t)),
            cost=answer.cost,
            status=answer.status,
            message=answer.message,
        )

    @property
    def guess(self) -> Guess:
        """The trajectory that the arcs come from."""
        s = np.linspace(0.0, len(self.arcs), _SAMPLES * len(self.arcs) + 1)
        edges = np.concatenate([[0.0], np.cumsum(self.lengths)])
        times = np.interp(s, np.arange(len(edges)), edges) + self.start.t[0]
        x = np.hstack([self.start.state(times), times[:, None], np.tile(self.lengths, (len(s), 1))])
        return Guess(x=x, u=self.start.control(times))


def _between(low: float, high: float) -> float:
    """A number inside two bounds."""
    if np.isfinite(low) and np.isfinite(high):
        return (low + high) / 2.0
    if np.isfinite(low) or np.isfinite(high):
        return low + 1.0 if np.isfinite(low) else high - 1.0
    return 0.0
