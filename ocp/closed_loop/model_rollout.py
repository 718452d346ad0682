"""Controls tried on the model before anybody applies them."""

from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp.codegen.buffered_function import BufferedFunction
from ocp.codegen.compile import compiled
from ocp.integration.one_step import RK4, Stage
from ocp.problem.cache import once_per_problem
from ocp.problem.constraint_rows import ImposedRows, ProblemRows, Violation
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

    The state at the first node is measured and cannot be changed: only what depends on the
    control is checked there. At the last node a plan has no control, as in the program of its
    solver, so only what depends on the state alone is checked; of a plant in continuous time the
    last control acts up to that instant.

    Attributes:
        ocp: the problem.
        n: number of intervals.
        compiled: whether the model runs as machine code.
        control_at_end: whether the last control still acts at the last node.
        imposed: what is checked; default: all rows of the problem.
    """

    ocp: OCP
    n: int
    compiled: bool = False
    control_at_end: bool = False
    imposed: ImposedRows | None = None

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
        """Return the largest violation along states (N + 1, nx), controls (N, nu), and its name.

        It is relative to the sizes of ``imposed``, where there are any.
        """
        rows, found = self._rows, []
        sizes = self.imposed.sizes if self.imposed else None
        if rows.states.is_imposed and not rows.states.box.contains(x[1:]):
            exempt = self._exempt_states[1:]
            own = sizes and sizes.states
            found.append(rows.states.largest_violation(x[1:], t[1:], exempt=exempt, sizes=own))
        if rows.controls.is_imposed and not rows.controls.box.contains(u):
            found.append(rows.controls.largest_violation(u, t, sizes=sizes and sizes.controls))
        if rows.path.is_imposed:
            nodes = np.vstack([p[0], p[1][-1:]])
            values = self._path(x.T, np.vstack([u, u[-1:]]).T, t[None, :], nodes.T)[0].T
            own = sizes and sizes.path
            found.append(rows.path.largest_violation(values, t, exempt=self._exempt, sizes=own))
        return _in_words(max(found, key=_relative)) if found else (0.0, "")

    def each_excess(
        self, x: np.ndarray, u: np.ndarray, t: np.ndarray, p: IntervalParameters
    ) -> tuple[Violation, ...]:
        """Return the largest violation of every row that limits anything, as ``excess`` sees it."""
        rows, found = self._rows, []
        if rows.states.is_imposed:
            exempt = self._exempt_states[1:]
            found += rows.states.largest_of_each(x[1:], t[1:], exempt=exempt)
        if rows.controls.is_imposed:
            found += rows.controls.largest_of_each(u, t)
        if rows.path.is_imposed:
            nodes = np.vstack([p[0], p[1][-1:]])
            values = self._path(x.T, np.vstack([u, u[-1:]]).T, t[None, :], nodes.T)[0].T
            found += rows.path.largest_of_each(values, t, exempt=self._exempt)
        return tuple(v for v in found if v.row is not None and v.row.is_limited)

    def end_excess(self, x: np.ndarray, t: float, p: np.ndarray) -> tuple[float, str]:
        """Return the largest violation of a terminal constraint by a final state (nx,)."""
        terminal = self._rows.terminal
        if not terminal:
            return 0.0, ""
        (values,) = self._end(x, t, p)
        sizes = self.imposed.sizes if self.imposed else None
        own = sizes and sizes.terminal
        return _in_words(terminal.largest_violation(values.T, np.array([t]), sizes=own))

    @property
    def _rows(self) -> ProblemRows:
        return self.imposed.rows if self.imposed else self.ocp.rows

    @cached_property
    def _rollout(self) -> BufferedFunction:
        step = (_compiled_step if self.compiled else _step)(self.ocp)
        return BufferedFunction(step.mapaccum(self.n))

    @cached_property
    def _path(self) -> BufferedFunction:
        return BufferedFunction(self.ocp.functions.path.map(self.n + 1))

    @cached_property
    def _end(self) -> BufferedFunction:
        return BufferedFunction(self.ocp.functions.terminal)

    @cached_property
    def _exempt(self) -> np.ndarray:
        """Where path constraints do not hold, bool (N + 1, m), see the class."""
        rows = self.ocp.rows.path
        exempt = np.zeros((self.n + 1, len(rows)), dtype=bool)
        exempt[0] = ~rows.on_control
        exempt[-1] |= rows.on_control & (not self.control_at_end)
        if self.imposed and self.imposed.no_control_rows is not None:
            exempt |= self.imposed.no_control_rows[:, None] & rows.on_control
        return exempt | (self._no_state_rows[:, None] & ~rows.on_control)

    @cached_property
    def _exempt_states(self) -> np.ndarray:
        """Where bounds of states do not hold, bool (N + 1, nx)."""
        return np.tile(self._no_state_rows[:, None], self.ocp.model.nx)

    @property
    def _no_state_rows(self) -> np.ndarray:
        if self.imposed is None or self.imposed.no_state_rows is None:
            return np.zeros(self.n + 1, dtype=bool)
        return self.imposed.no_state_rows


@once_per_problem
def _step(ocp: OCP) -> ca.Function:
    return Stage.of(ocp, RK4(), held=True).step


@once_per_problem
def _compiled_step(ocp: OCP) -> ca.Function:
    return compiled(_step(ocp))


_relative = attrgetter("relative")


def _in_words(violation: Violation) -> tuple[float, str]:
    return violation.relative, str(violation)
