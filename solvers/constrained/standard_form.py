"""Constraints and state bounds of a problem, each as a row that must not be positive."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp import OCP, Constraint, Evaluation


@dataclass(frozen=True, eq=False)
class StandardForm:
    r"""Rows in standard form.

    .. math:: c_i(x, u, t, p) \le 0 \quad \text{or, for an equation,} \quad c_i(x, u, t, p) = 0

    Attributes:
        ocp: the problem whose symbols the rows are written in.
        c: the rows (m,).
        is_equation: which of them are equations, bool (m,).
        names: of the constraint or bound behind each row.
    """

    ocp: OCP
    c: ca.SX
    is_equation: np.ndarray
    names: tuple[str, ...]

    @classmethod
    def along(cls, ocp: OCP) -> "StandardForm":
        """Return path constraints and state bounds."""
        return cls._of(ocp, [*ocp.at("path"), *_bounds(ocp)])

    @classmethod
    def at_end(cls, ocp: OCP) -> "StandardForm":
        """Return terminal constraints, and the rows along the way that no control decides.

        A trajectory that is pressed against a bound at the final time needs a multiplier of
        that instant alone: the multiplier of the path has an atom there.
        """
        along, end = cls.along(ocp), cls._of(ocp, ocp.at("terminal"))
        free = [i for i in range(along.size) if not ca.depends_on(along.c[i], ocp.model.u)]
        return cls(
            ocp,
            ca.vertcat(end.c, along.c[free]),
            np.concatenate([end.is_equation, along.is_equation[free]]),
            (*end.names, *[along.names[i] for i in free]),
        )

    @classmethod
    def _of(cls, ocp: OCP, constraints: Iterable[Constraint]) -> "StandardForm":
        rows = [row for c in constraints for row in _standard_form(c)]
        return cls(
            ocp,
            ca.vertcat(ca.SX(0, 1), *[c for c, _, _ in rows]),
            np.array([equation for _, equation, _ in rows], dtype=bool),
            tuple(name for _, _, name in rows),
        )

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.names)

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
        on_control = np.array(ca.DM(self.function.jac_sparsity(0, 1), 1.0)).any(axis=1)
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
        return f"'{self.names[i]}' is violated by {excess[k, i]:.3g} at t = {times[k]:.4g} s"

    def at_final(self, verdict: Evaluation) -> np.ndarray:
        """Return the values of the rows at the final time, (m,)."""
        truth = verdict.truth
        last = self.function(truth.x[-1], truth.u_end[-1], truth.t[-1], truth.p_end[-1])
        return np.array(last).ravel()

    def _worse(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        larger = np.where(self.is_equation, np.abs(a) >= np.abs(b), a >= b)
        return np.where(larger, a, b)


def _standard_form(c: Constraint) -> Iterator[tuple[ca.SX, bool, str]]:
    bounds = zip(np.asarray(c.lower), np.asarray(c.upper), strict=True)
    for row, (lower, upper) in zip(ca.vertsplit(c.expression), bounds, strict=True):
        if lower == upper:
            yield row - upper, True, c.name
            continue
        if np.isfinite(lower):
            yield lower - row, False, c.name
        if np.isfinite(upper):
            yield row - upper, False, c.name


def _bounds(ocp: OCP) -> Iterator[Constraint]:
    lower, upper = np.asarray(ocp.state_bounds.lower), np.asarray(ocp.state_bounds.upper)
    for i, name in enumerate(ocp.model.x_names):
        yield Constraint(f"bound of {name}", ocp.model.x[i], lower[i], upper[i])
