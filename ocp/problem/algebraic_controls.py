"""Algebraic variables as controls: their equations hold along the way as constraints.

For methods that impose equations wherever they evaluate the dynamics: no root is looked for then.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.problem.algebraic import AlgebraicSolution
from ocp.problem.along_guess import along_guess
from ocp.problem.constraint import Box, Constraint, unused
from ocp.problem.guess import Guess
from ocp.problem.ocp import OCP


@dataclass(frozen=True, eq=False)
class AlgebraicControls:
    """A problem with algebraic variables, and the same one where they are controls.

    Attributes:
        written: the problem with algebraic variables.
    """

    written: OCP

    @property
    def original(self) -> OCP:
        """The problem where they are solved for."""
        return self.written.explicit

    @cached_property
    def _linear(self) -> AlgebraicSolution:
        """What is linear is solved as an expression in both."""
        return AlgebraicSolution.of(self.written.model, roots=False)

    @property
    def is_needed(self) -> bool:
        """Whether there is anything that only a root finder can solve."""
        return bool(self._linear.columns)

    @cached_property
    def problem(self) -> OCP:
        """The problem whose last controls are the variables that are not linear."""
        ocp, solved, count = self.written, self._linear, len(self._linear.columns)
        terms, model = ocp.terms(solved), solved.explicit_model
        names = {c.name for c in (*ocp.constraints, *ocp.invariants)}
        zero = np.zeros(count)
        equations = Constraint(
            unused("algebraic equations", names),
            solved(ocp.model.algebraic[list(solved.rows)]),
            zero,
            zero,
        )
        units, nominal = ocp.model.z_units, model.u_nominal
        more = [units[i] for i in solved.columns] if units else [""] * count
        if nominal is not None:
            nominal = np.append(np.broadcast_to(nominal, model.nu), self._sizes)
        model = replace(
            model,
            u=ca.vertcat(model.u, self._own),
            u_units=(*model.u_units, *more) if model.u_units else (),
            u_nominal=nominal,
        )
        return replace(
            ocp,
            **(terms | {"constraints": (*terms["constraints"], equations)}),
            model=model,
            control_bounds=ocp.control_bounds & Box.unbounded(count),
            guess=self._first_guess(),
        )

    @property
    def first_controls(self) -> np.ndarray:
        """Controls of the original to begin with where a guess has none, (nu,)."""
        return self.written.control_bounds.inside()

    def _first_guess(self) -> Guess:
        """Return controls to begin with, and the variables that fit to them at the start."""
        u = self.first_controls
        return Guess(u=np.append(u, self.slacks(np.zeros(1), None, u[None, :])[0]))

    def slacks(self, fractions: np.ndarray, x: np.ndarray | None, u: np.ndarray) -> np.ndarray:
        """Return the variables that fit, (k, m); where there is no root, where it is looked for.

        Args:
            fractions: of the horizon, (k,).
            x: states, (k, nx); None: the start.
            u: controls, (k, nu).
        """
        both = along_guess(self.original, self._values, fractions, x, u)
        root, guess = np.split(both, 2, axis=1)
        return np.where(np.isfinite(root), root, guess)

    @property
    def _own(self) -> ca.SX:
        return self.written.model.z[list(self._linear.columns)]

    @cached_property
    def _values(self) -> ca.Function:
        """(x, u, t, p) -> the variables, and where they are looked for."""
        ocp, own = self.original, list(self._linear.columns)
        m, written = ocp.model, self.written.model
        values = [self.written.algebraic_solution.values[own], written.z_start[own]]
        return ca.Function("variables", [m.x, m.u, m.t, ocp.p], [ca.densify(ca.vertcat(*values))])

    @property
    def _sizes(self) -> np.ndarray:
        """Typical sizes: of the guess."""
        found = np.abs(self.slacks(np.zeros(1), None, self.first_controls[None, :]))[0]
        return np.where(found > 0.0, found, 1.0)
