"""Controls tried on the model before anybody applies them."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp.codegen.buffered_function import BufferedFunction
from ocp.codegen.compile import compiled
from ocp.integration.one_step import RK4, Stage
from ocp.problem.cache import once_per_problem
from ocp.problem.constraint import Box, stacked_box
from ocp.problem.ocp import OCP

# Parameters at the left and at the right end of each interval, (N, n_p) each.
IntervalParameters = tuple[np.ndarray, np.ndarray]


class RolloutResult(NamedTuple):
    """What the model does under given controls.

    Attributes:
        x: states (N + 1, nx).
        cost: integrated running cost.
        excess: largest violation of a bound or path constraint from the first step on; inf
            where the state blows up.
        worst: what is violated most.
    """

    x: np.ndarray
    cost: float
    excess: float
    worst: str


@dataclass(frozen=True, eq=False)
class ModelRollout:
    """Roll-outs of a problem over N intervals, and the check of its constraints.

    The state at the first node is measured: nothing can be done about it, so only what
    depends on the control is checked there.

    Attributes:
        ocp: the problem.
        n: number of intervals.
        compiled: whether the model runs as machine code.
    """

    ocp: OCP
    n: int
    compiled: bool = False

    def of(
        self, x0: np.ndarray, u: np.ndarray, t: np.ndarray, p: IntervalParameters
    ) -> RolloutResult:
        """Roll controls u (N, nu), held between the instants t (N + 1,), out from x0 (nx,).

        The parameters are those at the left and at the right end of each interval.
        """
        left, right = p
        inputs = (u.T, t[None, :-1], np.diff(t)[None, :], left.T, right.T)
        x, cost = self._rollout(x0, *inputs)
        states = np.vstack([x0, x.T])
        if not np.isfinite(states).all():
            return RolloutResult(np.tile(x0, (self.n + 1, 1)), np.inf, np.inf, "the state blows up")
        return RolloutResult(states, float(np.sum(cost)), *self.excess(states, u, t, p))

    def excess(
        self, x: np.ndarray, u: np.ndarray, t: np.ndarray, p: IntervalParameters
    ) -> tuple[float, str]:
        """Return the largest violation along states (N + 1, nx), controls (N, nu), and its name."""
        ocp, m = self.ocp, self.ocp.model
        found = [(0.0, "")]
        if ocp.state_bounds.is_active:
            found.append(_largest("state", m.x_names, ocp.state_bounds.excess(x[1:])))
        if ocp.control_bounds.is_active:
            found.append(_largest("control", m.u_names, ocp.control_bounds.excess(u)))
        if self._path_names:
            nodes = np.vstack([p[0], p[1][-1:]])
            rows = self._path(x.T, np.vstack([u, u[-1:]]).T, t[None, :], nodes.T)[0].T
            excess = self._path_box.excess(rows)
            excess[0, ~ocp.functions.path_on_control] = 0.0
            found.append(_largest("constraint", self._path_names, excess))
        return max(found)

    def end_excess(self, x: np.ndarray, t: float, p: np.ndarray) -> tuple[float, str]:
        """Return the largest violation of a terminal constraint by a final state (nx,)."""
        terminal = self.ocp.at("terminal")
        if not terminal:
            return 0.0, ""
        rows = np.array(self.ocp.functions.terminal(x, t, p)).T
        names = tuple(c.name for c in terminal for _ in range(c.size))
        return _largest("terminal constraint", names, stacked_box(terminal).excess(rows))

    @cached_property
    def _rollout(self) -> BufferedFunction:
        step = (_compiled_step if self.compiled else _step)(self.ocp)
        return BufferedFunction(step.mapaccum(self.n))

    @cached_property
    def _path(self) -> BufferedFunction:
        return BufferedFunction(self.ocp.functions.path.map(self.n + 1))

    @cached_property
    def _path_names(self) -> tuple[str, ...]:
        return tuple(c.name for c in self.ocp.at("path") for _ in range(c.size))

    @cached_property
    def _path_box(self) -> Box:
        return stacked_box(self.ocp.at("path"))


@once_per_problem
def _step(ocp: OCP) -> ca.Function:
    return Stage.of(ocp, RK4(), held=True).step


@once_per_problem
def _compiled_step(ocp: OCP) -> ca.Function:
    return compiled(_step(ocp))


def _largest(kind: str, names: tuple[str, ...], excess: np.ndarray) -> tuple[float, str]:
    k, i = np.unravel_index(int(excess.argmax()), excess.shape)
    return float(excess[k, i]), f"{kind} {names[i]} is violated by {excess[k, i]:.3g}"
