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
        z: algebraic variables (K, nz).
        p: parameters and signals (K, n_p), left and right.
    """

    ocp: OCP
    t: np.ndarray
    x: np.ndarray
    u: np.ndarray
    z: np.ndarray
    p: np.ndarray

    @classmethod
    def of(cls, solution: PlottableSolution) -> "Trajectory":
        """Sample a solution."""
        instants, values = drawn_instants(solution), solution.data.values
        fractions = (instants - solution.t[0]) / solution.duration
        is_continuous = solution.control_kind == "linear"
        before = instants - (0.0 if is_continuous else _BEFORE * solution.duration)
        before = np.maximum(before, solution.t[0])

        def both(left: np.ndarray, right: np.ndarray) -> np.ndarray:
            rows = np.empty((2 * len(left), *left.shape[1:]))
            rows[::2], rows[1::2] = left, right
            return rows[1:-1]

        x, z = solution.state(instants), np.empty((len(instants), 0))
        z = (z, z)
        if solution.problem.model.nz:
            z = (solution.algebraic(before), solution.algebraic(instants))
        return cls(
            ocp=solution.problem,
            t=both(instants, instants),
            x=both(x, x),
            u=both(solution.control(before), solution.control(instants)),
            z=both(*z),
            p=both(values.at(fractions, -1), values.at(fractions, 1)),
        )

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


def drawn_instants(solution: PlottableSolution) -> np.ndarray:
    """Return the nodes, where signals jump, and many more where controls are curved."""
    knots = solution.t[0] + solution.data.values.knots * solution.duration
    parts = [solution.t, knots]
    if solution.control_kind in ("extremal", "polynomial"):
        parts.append(np.linspace(solution.t[0], solution.t[-1], _POINTS))
    found = np.unique(np.concatenate(parts))
    apart = np.diff(found, prepend=-np.inf) > 10 * _BEFORE * solution.duration
    return found[apart]
