"""The cost as a function of the controls alone: states forwards, costates backwards."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp import OCP, Integrator, UnsupportedProblem
from ocp.internal import (
    BufferedFunction,
    ControlBlocks,
    RunData,
    Stage,
    compiled,
    hamiltonian,
    node_widths,
    time_unit,
)
from solvers.gradient.line_search import LineSearchTrial


@dataclass(frozen=True, eq=False)
class ControlIterate:
    """Controls with all that follows from them.

    Attributes:
        trial: controls, states and cost.
        costate: (N + 1, nx).
        gradient: dJ/du, (N, nu), per second of an interval.
    """

    trial: LineSearchTrial
    costate: np.ndarray
    gradient: np.ndarray

    @property
    def is_finite(self) -> bool:
        """Whether neither the state nor its costate blew up."""
        return bool(np.isfinite(self.trial.cost))


@dataclass(frozen=True, eq=False)
class AdjointSweeps:
    """Both integrations of a problem over N intervals, compiled once.

    Attributes:
        ocp: the problem.
        nodes: as fractions of the horizon, (N + 1,).
        exact: whether ``backwards`` is the adjoint of ``forwards``, or integrates (3.62).
        forwards: (x0, u, t, h, p0, p1) -> x after each interval and its cost.
        backwards: (costate at the end, x, [x after,] u, t, h, p0, p1), the last interval first
            -> costate before each interval and dJ/du.
        final_cost: phi of (x, t, p).
        final_gradient: phi_x of (x, t, p).
        blocks: controls that are held over several intervals.
    """

    ocp: OCP
    nodes: np.ndarray
    exact: bool
    forwards: BufferedFunction
    backwards: BufferedFunction
    final_cost: BufferedFunction
    final_gradient: BufferedFunction
    blocks: ControlBlocks | None = None

    @property
    def n(self) -> int:
        """Number of intervals N."""
        return len(self.nodes) - 1

    @classmethod
    def of(
        cls, ocp: OCP, nodes: np.ndarray, integrator: Integrator, *, exact: bool, fast: bool
    ) -> "AdjointSweeps":
        """Do all symbolic work; ``fast``: with the stages as machine code."""
        if ocp.model.is_discrete and not exact:
            raise UnsupportedProblem(
                f"{ocp.name}: the model is discrete in time; use gradient='discrete'"
            )
        n, stage = len(nodes) - 1, Stage.of(ocp, integrator, held=True)
        step, back = stage.step, stage.adjoint if exact else _costate_step(ocp, integrator)
        if fast:
            step, back = compiled(step), compiled(back)
        ends = ocp.functions.terminal_cost, ocp.functions.terminal_gradient
        forwards, backwards = map(BufferedFunction, (step.mapaccum(n), back.mapaccum(n)))
        final_cost, final_gradient = map(BufferedFunction, ends)
        return cls(ocp, nodes, exact, forwards, backwards, final_cost, final_gradient)


class Objective:
    """J(u) and its gradient for the data of one run, and how often they were asked for.

    Attributes:
        sweeps: the integrations.
        data: of the run.
        nodes: as fractions of the horizon, (N + 1,).
        h: lengths of the intervals [s], (N,); 1 in discrete time.
        weight: of the controls in the inner product, (N, 1): h in the problem's unit of time.
        rollouts: integrations forwards so far.
        backward: integrations backwards so far.
    """

    def __init__(self, sweeps: AdjointSweeps, data: RunData) -> None:
        """Lay out the intervals."""
        ocp, n = sweeps.ocp, sweeps.n
        self.sweeps, self.data, self.box = sweeps, data, ocp.control_bounds
        self.nodes = sweeps.nodes
        self.h = np.ones(n) if ocp.model.is_discrete else ocp.duration * node_widths(self.nodes)
        self.weight = self.h[:, None] / time_unit(ocp)
        left, right = data.values.on(self.nodes)
        t = data.t0 + self.nodes[None, :-1] * ocp.duration
        self._schedule = [t, self.h[None, :], left.T, right.T]
        self._end = (data.t0 + ocp.duration, data.values.at(1.0)[0])
        self.rollouts = self.backward = 0

    def rolled_out(self, u: np.ndarray) -> LineSearchTrial:
        """Integrate (3.61) forwards along controls (N, nu), clipped to their bounds."""
        u, x0, blocks = self.box.clip(u), self.data.x0, self.sweeps.blocks
        u = u if blocks is None else blocks.holding(u)
        x, costs = self.sweeps.forwards(x0, u.T, *self._schedule)
        self.rollouts += 1
        x = np.vstack([x0, x.T])
        final = self.sweeps.final_cost(x[-1], *self._end)[0]
        cost = float(np.sum(costs) + final.item())
        return LineSearchTrial(u, x, cost if np.isfinite(cost) and np.isfinite(x).all() else np.inf)

    def differentiated(self, trial: LineSearchTrial) -> ControlIterate:
        """Integrate (3.62) backwards along a trial; at rest where either way blew up."""
        if not np.isfinite(trial.cost):
            return self._at_rest(trial.u)
        final = self.sweeps.final_gradient(trial.x[-1], *self._end)[0].ravel()
        after = [] if self.sweeps.exact else [trial.x[1:].T]
        along = [trial.x[:-1].T, *after, trial.u.T, *self._schedule]
        costate, gradient = self.sweeps.backwards(final, *(a[:, ::-1] for a in along))
        self.backward += 1
        costate = np.vstack([costate.T[::-1], final])
        if not (np.isfinite(costate).all() and np.isfinite(gradient).all()):
            return self._at_rest(trial.u)
        gradient = gradient.T[::-1] / self.weight
        if self.sweeps.blocks is not None:
            gradient = self.sweeps.blocks.mean(gradient, self.h)
        return ControlIterate(trial, costate, gradient)

    def _at_rest(self, u: np.ndarray) -> ControlIterate:
        """What there is to show of controls along which something blows up."""
        still = np.tile(self.data.x0, (self.sweeps.n + 1, 1))
        return ControlIterate(
            LineSearchTrial(u, still, np.inf), np.zeros_like(still), np.zeros_like(u)
        )

    def free_gradient(self, iterate: ControlIterate) -> np.ndarray:
        """The gradient, without components that would only push into a bound."""
        u, g = iterate.trial.u, iterate.gradient
        blocked = ((u <= np.asarray(self.box.lower)) & (g > 0.0)) | (
            (u >= np.asarray(self.box.upper)) & (g < 0.0)
        )
        return np.where(blocked, 0.0, g)

    def residual(self, iterate: ControlIterate) -> float:
        """Return the largest projected gradient."""
        return float(np.abs(self.free_gradient(iterate)).max(initial=0.0))

    def inner(self, a: np.ndarray, b: np.ndarray) -> float:
        """(a, b), the integral of a'b over the horizon: Algorithm 2's inner product."""
        return float(np.vdot(self.weight * a, b))


def _costate_step(ocp: OCP, integrator: Integrator) -> ca.Function:
    """One backward step of (3.62), the state interpolated between its nodes, and H_u there."""
    h, m, n_p = hamiltonian(ocp), ocp.model, ocp.p.numel()
    sizes = {
        "costate": m.nx,
        "x": m.nx,
        "x_next": m.nx,
        "u": m.nu,
        "t": 1,
        "h": 1,
        "p0": n_p,
        "p1": n_p,
    }
    s = {name: ca.SX.sym(name, size) for name, size in sizes.items()}

    def rate(costate: ca.SX, back: ca.SX | float) -> ca.SX:
        """d(costate) over the fraction of the interval, counted from its end."""
        x = s["x_next"] + back * (s["x"] - s["x_next"])
        p = s["p1"] + back * (s["p0"] - s["p1"])
        t = s["t"] + (1.0 - back) * s["h"]
        return -s["h"] * h.costate_rate(x, s["u"], costate, t, p)

    before = integrator(rate, s["costate"], 0.0, 1.0)
    slope = h.control_gradient(s["x"], s["u"], before, s["t"], s["p0"])
    return ca.Function("costate_step", list(s.values()), [before, s["h"] * slope])
