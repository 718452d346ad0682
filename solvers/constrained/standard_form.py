"""Constraints and state bounds of a problem, each as a row that must not be positive."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp import OCP, Evaluation
from ocp.internal import ConstraintRow, ConstraintRows, Violation


@dataclass(frozen=True, eq=False)
class StandardForm:
    r"""Rows in standard form.

    .. math:: c_i(x, u, t, p) \le 0 \quad \text{or, for an equation,} \quad c_i(x, u, t, p) = 0

    Attributes:
        ocp: the problem whose symbols the rows are written in.
        c: the rows (m,).
        rows: what is behind each of them.
    """

    ocp: OCP
    c: ca.SX
    rows: tuple[ConstraintRow, ...]

    @classmethod
    def along(cls, ocp: OCP) -> "StandardForm":
        """Return path constraints and state bounds."""
        return cls._of(ocp, ocp.rows.path + ocp.rows.states)

    @classmethod
    def at_end(cls, ocp: OCP) -> "StandardForm":
        """Return terminal constraints, and the rows along the way that no control decides.

        A trajectory that is pressed against a bound at the final time needs a multiplier of
        that instant alone: the multiplier of the path has an atom there.
        """
        path = ocp.rows.path
        return cls._of(ocp, ocp.rows.terminal + path.where(~path.on_control) + ocp.rows.states)

    @classmethod
    def _of(cls, ocp: OCP, rows: ConstraintRows) -> "StandardForm":
        """Return equations as they are, and every finite side of an inequality as a row."""
        parts: list[tuple[ca.SX, ConstraintRow]] = []
        for row, value in zip(rows.rows, ca.vertsplit(rows.expression), strict=True):
            if np.isfinite(row.lower) and not row.is_equation:
                parts.append((row.lower - value, row))
            if np.isfinite(row.upper):
                parts.append((value - row.upper, row))
        return cls(
            ocp, ca.vertcat(ca.SX(0, 1), *[c for c, _ in parts]), tuple(row for _, row in parts)
        )

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.rows)

    @cached_property
    def is_equation(self) -> np.ndarray:
        """Which of them are equations, bool (m,)."""
        return np.array([row.is_equation for row in self.rows], dtype=bool)

    @cached_property
    def function(self) -> ca.Function:
        """The rows as a Function of (x, u, t, p)."""
        m = self.ocp.model
        return ca.Function("rows", [m.x, m.u, m.t, self.ocp.p], [ca.densify(self.c)])

    def worst_near_nodes(self, verdict: Evaluation, fractions: np.ndarray) -> np.ndarray:
        """Return the worst value of each row near each node, (N + 1, m).

        Near a node is what is nearer to it than to any other. The value of an inequality is
        its largest, that of an equation the one largest in absolute value. The trajectory is
        the referee's, so that nothing between the nodes is missed.
        """
        truth = verdict.truth
        along = self.function.map(len(truth.t) - 1)
        starts = along(truth.x[:-1].T, truth.u_start.T, truth.t[None, :-1], truth.p_start.T)
        ends = along(truth.x[1:].T, truth.u_end.T, truth.t[None, 1:], truth.p_end.T)
        values = self._worse(np.array(starts).T, np.array(ends).T)
        share = ((truth.t[1:] + truth.t[:-1]) / 2 - truth.t[0]) / (truth.t[-1] - truth.t[0])
        borders = np.concatenate([[0.0], (fractions[1:] + fractions[:-1]) / 2, [1.0]])
        first = np.minimum(np.searchsorted(share, borders[:-1]), len(share) - 1)
        last = np.maximum(np.searchsorted(share, borders[1:]), first + 1)
        key = np.where(self.is_equation, np.abs(values), values)
        chosen = [a + key[a:b].argmax(axis=0) for a, b in zip(first, last, strict=True)]
        return np.take_along_axis(values, np.array(chosen), axis=0)

    def start_violation(self, verdict: Evaluation) -> float:
        """Return by how much the start itself violates rows that no control decides."""
        truth = verdict.truth
        on_control = np.array([row.on_control for row in self.rows], dtype=bool)
        first = self.function(truth.x[0], truth.u_start[0], truth.t[0], truth.p_start[0])
        value = np.array(first).ravel()
        excess = np.where(self.is_equation, np.abs(value), value)[~on_control]
        return float(excess.max(initial=0.0))

    def worst_in_words(self, values: np.ndarray, times: np.ndarray) -> str:
        """Say which row is violated most near which node; nothing if none is."""
        excess = np.where(self.is_equation, np.abs(values), values)
        if excess.max(initial=0.0) <= 0.0:
            return ""
        k, i = np.unravel_index(int(excess.argmax()), excess.shape)
        return str(Violation(float(excess[k, i]), self.rows[i], float(times[k])))

    def at_final(self, verdict: Evaluation) -> np.ndarray:
        """Return the values of the rows at the final time, (m,)."""
        truth = verdict.truth
        last = self.function(truth.x[-1], truth.u_end[-1], truth.t[-1], truth.p_end[-1])
        return np.array(last).ravel()

    def _worse(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        larger = np.where(self.is_equation, np.abs(a) >= np.abs(b), a >= b)
        return np.where(larger, a, b)
