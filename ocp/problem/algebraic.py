r"""Algebraic variables of index 1, solved for.

.. math:: 0 = g(x, u, z, t, p), \quad \det g_z \ne 0 \quad \Rightarrow \quad z = Z(x, u, t, p)
"""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp.checks.errors import ProblemError
from ocp.checks.expressions import readable
from ocp.expressions.equations import solve_equations, undetermined
from ocp.problem.model import Model

# The Jacobian counts as singular below this, where its largest entries are 1.
_SINGULAR = 1e-10
_LOWER_THE_INDEX = (
    "Differentiate it along the dynamics until it determines one, and keep what it said as an "
    "'initial' constraint"
)


@dataclass(frozen=True, eq=False)
class AlgebraicSolution:
    """The algebraic variables of a model in terms of everything else.

    Attributes:
        model: as it was written.
        values: z, expressions in x, u, t and parameters (nz,), and in those of z that are not
            solved for.
        rows: the equations that are not solved.
        columns: the variables that are not solved for.
    """

    model: Model
    values: ca.SX
    rows: tuple[int, ...] = ()
    columns: tuple[int, ...] = ()

    @classmethod
    def of(cls, model: Model, *, roots: bool = True) -> "AlgebraicSolution":
        """Solve the equations of a model.

        Args:
            model: with algebraic variables.
            roots: whether to look for roots; else only what is linear is solved.

        Raises:
            ProblemError: where they cannot determine the variables, naming an equation; where a
                root has to be looked for and there is no guess.
        """
        g, z = model.algebraic, model.z
        if not model.nz:
            return cls(model, z)
        if (row := undetermined(g, z)) is not None:
            raise ProblemError(
                f"model '{model.name}': {_equation(model, row)} cannot determine a variable of its "
                f"own, the others determine all that are in it: its index is higher than 1. "
                f"{_LOWER_THE_INDEX}"
            )
        linear = solve_equations(g, z, model.z_start, roots=False)
        if not (roots and linear.columns):
            return cls(model, *linear)
        if model.z_guess is None:
            raise ProblemError(
                f"model '{model.name}': {readable(g[linear.rows[0]])} = 0 is not linear in "
                f"{z[linear.columns[0]]}: Newton's method needs Model(z_guess=...) to start from, "
                "which also says which root is meant"
            )
        return cls(model, *solve_equations(g, z, model.z_start))

    def __call__(self, expression: ca.SX | float) -> ca.SX:
        """Return an expression with the variables replaced by what they are."""
        return ca.substitute(ca.SX(expression), self.model.z, self.values)

    @property
    def explicit_model(self) -> Model:
        """The model without algebraic variables."""
        none = ca.SX(0, 1)
        return replace(
            self.model, f=self(self.model.f), z=none, algebraic=none, z_guess=None, z_units=()
        )


def _equation(model: Model, row: int) -> str:
    return f"algebraic equation {row} (0 = {readable(model.algebraic[row])})"


def refuse_unsolvable(
    solution: AlgebraicSolution, p: ca.SX, points: list[tuple[np.ndarray | float, ...]]
) -> None:
    """Refuse equations that have no root, or a singular Jacobian, wherever they are looked at.

    Args:
        solution: the variables in terms of everything else.
        p: parameters of the problem (n_p,).
        points: values of x, u, t and p.

    Raises:
        ProblemError: naming the equation or the variable.
    """
    model = solution.model
    slopes = ca.substitute(ca.jacobian(model.algebraic, model.z), model.z, model.z_start)
    outputs = [ca.densify(slopes), ca.densify(solution.values)]
    at = ca.Function("root", [model.x, model.u, model.t, p], outputs)
    found = [[np.array(value) for value in at(*point)] for point in points]
    singular = [row for jacobian, _ in found for row in _singular_rows(jacobian)]
    if len(singular) == len(points):
        raise ProblemError(
            f"model '{model.name}': {_equation(model, singular[0])} does not determine a variable "
            "of its own at the start: the Jacobian of the algebraic equations is singular there. "
            f"{_LOWER_THE_INDEX}; if it is singular only at this z_guess, give another"
        )
    missing = [np.flatnonzero(~np.isfinite(values)) for _, values in found]
    if all(rows.size for rows in missing):
        row = int(missing[0][0])
        raise ProblemError(
            f"model '{model.name}': at the start no root of the algebraic equations is found for "
            f"{model.z_names[row]} from z_guess; is there one, and near the guess?"
        )


def _singular_rows(jacobian: np.ndarray) -> list[int]:
    """Return the row that depends on the others most, nothing where none does."""
    if not np.isfinite(jacobian).all():
        return []
    for axis in (1, 0):
        most = np.abs(jacobian).max(axis=axis, keepdims=True)
        jacobian = jacobian / np.where(most > 0.0, most, 1.0)
    directions, values, _ = np.linalg.svd(jacobian)
    return [int(np.abs(directions[:, -1]).argmax())] if values[-1] < _SINGULAR else []
