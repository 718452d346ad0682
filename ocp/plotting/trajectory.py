"""Everything of a solution at many instants, each twice: just before it and just after it."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.plotting.plottable import PlottableSolution
from ocp.problem.ocp import OCP

# Instants of a control that is curved between the nodes.
_POINTS = 600
# Just before an instant, in durations: nearer than any two nodes, farther than rounding.
_BEFORE = 1e-7


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Values of one run at the instants that are drawn.

    Attributes:
        ocp: the problem.
        t: instants [s], each but the ends twice, (K,).
        x: states (K, nx).
        u: controls (K, nu), left and right of every instant.
        p: parameters and signals (K, n_p), left and right.
    """

    ocp: OCP
    t: np.ndarray
    x: np.ndarray
    u: np.ndarray
    p: np.ndarray

    @classmethod
    def of(cls, solution: PlottableSolution) -> "Trajectory":
        """Sample a solution."""
        instants, values = drawn_instants(solution), solution.data.values
        fractions = (instants - solution.t[0]) / solution.duration
        is_continuous = solution.control_kind == "linear"
        before = instants - (0.0 if is_continuous else _BEFORE * solution.duration)
        before = np.maximum(before, solution.t[0])
        return cls(
            ocp=solution.problem,
            t=both_sides(instants, instants),
            x=both_sides(*[solution.state(instants)] * 2),
            u=both_sides(solution.control(before), solution.control(instants)),
            p=both_sides(values.at(fractions, -1), values.at(fractions, 1)),
        )

    @cached_property
    def z(self) -> np.ndarray:
        """Algebraic variables (K, nz), as the problem's own equations give them."""
        if not self.ocp.model.nz:
            return np.empty((len(self.t), 0))
        function = self.ocp.functions.algebraic.map(len(self.t))
        return np.array(function(self.x.T, self.u.T, self.t[None, :], self.p.T)).T

    @cached_property
    def variables(self) -> np.ndarray:
        """States, controls and algebraic variables side by side, (K, nx + nu + nz)."""
        return np.hstack([self.x, self.u, self.z])

    def along(self, expression: ca.SX) -> np.ndarray:
        """Return a column (m,) of the problem's symbols along the way, (K, m)."""
        m = self.ocp.model
        function = ca.Function("along", [m.x, m.u, m.z, m.t, self.ocp.p], [ca.densify(expression)])
        given = (self.x, self.u, self.z, self.t[:, None], self.p)
        rows = np.array(function.map(len(self.t))(*[a.T for a in given]))
        return rows.T.reshape(len(self.t), expression.numel())


def both_sides(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return rows just before and just after each instant in turn; of the ends one."""
    rows = np.empty((2 * len(left), *left.shape[1:]))
    rows[::2], rows[1::2] = left, right
    return rows[1:-1]


def drawn_instants(solution: PlottableSolution) -> np.ndarray:
    """Return the nodes, where signals jump, and many more where controls are curved."""
    knots = solution.t[0] + solution.data.values.knots * solution.duration
    parts = [solution.t, knots]
    if solution.control_kind in ("extremal", "polynomial"):
        parts.append(np.linspace(solution.t[0], solution.t[-1], _POINTS))
    found = np.unique(np.concatenate(parts))
    apart = np.diff(found, prepend=-np.inf) > 10 * _BEFORE * solution.duration
    return found[apart]
