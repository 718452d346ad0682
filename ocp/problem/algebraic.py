r"""Algebraic variables of index 1, solved for.

.. math:: 0 = g(x, u, z, t, p), \quad \det g_z \ne 0 \quad \Rightarrow \quad z = Z(x, u, t, p)

Equations and variables are put into block triangular form [Pothen & Fan 1990]: blocks that are
linear in their own variables are solved as expressions, the others by Newton's method. The
derivatives of a root are those of the implicit function theorem, exact and of any order. Where
Newton's method finds no root, Z is NaN: a point that is no root must not pass for one.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp.checks.errors import ProblemError
from ocp.checks.expressions import readable
from ocp.problem.model import Model

# A root is found where no row is larger than this, relative to what its variables bring to it.
_ACCURACY = 1e-9
# Newton's method ends with a step that is so small, relative to the guess.
_NEWTON = {
    "abstol": 0.0,
    "abstolStep": 1e-12,
    "max_iter": 100,
    "error_on_fail": False,
    "show_eval_warnings": False,
}
# Steps in which a root is followed that is not found at once.
_STAGES = 24
# The Jacobian counts as singular below this, where its largest entries are 1.
_SINGULAR = 1e-10


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
        values, left = ca.SX(model.z), cls(model, model.z)
        if not model.nz:
            return left
        for rows, columns in _blocks(model):
            g, own = model.algebraic[rows], model.z[columns]
            slopes = ca.jacobian(g, own)
            if not ca.depends_on(slopes, own):
                found = -ca.solve(slopes, ca.substitute(g, own, ca.DM.zeros(own.shape)))
            elif roots:
                found = _root(model, g, columns)
            else:
                left = replace(left, rows=(*left.rows, *rows), columns=(*left.columns, *columns))
                continue
            values[columns] = ca.substitute(found, model.z, values)
        return replace(left, values=values)

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


def _blocks(model: Model) -> Iterator[tuple[list[int], list[int]]]:
    """Yield equations and the variables that they determine, in an order to solve them in."""
    pattern = ca.jacobian(model.algebraic, model.z).sparsity()
    if ca.sprank(pattern) < model.nz:
        raise ProblemError(
            f"model '{model.name}': {_equation(model, _superfluous(pattern))} cannot determine a "
            "variable of its own, the others determine all that are in it: its index is higher "
            f"than 1. {_LOWER_THE_INDEX}"
        )
    count, rows, columns, row_ends, column_ends, *_ = pattern.btf()
    for k in range(count):
        yield rows[row_ends[k] : row_ends[k + 1]], columns[column_ends[k] : column_ends[k + 1]]


_LOWER_THE_INDEX = (
    "Differentiate it along the dynamics until it determines one, and keep what it said as an "
    "'initial' constraint"
)


def _superfluous(pattern: ca.Sparsity) -> int:
    """Return the last equation without which as many variables are determined as with it."""
    count, columns = pattern.size1(), list(range(pattern.size2()))
    rank = ca.sprank(pattern)
    for i in reversed(range(count)):
        others = [k for k in range(count) if k != i]
        if ca.sprank(pattern.sub(others, columns)[0]) == rank:
            return i
    return count - 1


def _equation(model: Model, row: int) -> str:
    return f"algebraic equation {row} (0 = {readable(model.algebraic[row])})"


def _root(model: Model, g: ca.SX, columns: list[int]) -> ca.SX:
    """Return the root of g for some of the variables, an expression in all other symbols of it."""
    z = model.z[columns]
    if model.z_guess is None:
        raise ProblemError(
            f"model '{model.name}': {readable(g[0])} = 0 is not linear in {z[0]}: Newton's method "
            "needs Model(z_guess=...) to start from, which also says which root is meant"
        )
    first, own = model.z_start[columns], {e.element_hash() for e in ca.vertsplit(z)}
    given = [e for e in ca.symvar(ca.vertcat(g, first)) if e.element_hash() not in own]
    others = ca.vertcat(ca.SX(0, 1), *given)
    return _newton(z, others, g, first)(others)


def _newton(z: ca.SX, others: ca.SX, g: ca.SX, start: ca.SX) -> ca.Function:
    """(others) -> the root of g(z, others) that Newton's method finds from a start, or NaN.

    Where it does not converge at once, the root is followed from the start: of equations that the
    start solves, step by step to those that are asked for.
    """
    unit = ca.vertcat(*[_unit(e) for e in ca.vertsplit(start)])
    g, brought = (
        ca.substitute(e, z, unit * z) for e in (g, ca.fabs(ca.jacobian(g, z)) @ (ca.fabs(z) + unit))
    )
    holds = ca.Function("holds", [z, others], [ca.logic_all(ca.fabs(g) <= _ACCURACY * brought)])
    begin = ca.Function("begin", [others], [start / unit])
    left = ca.SX.sym("left")  # of what g is at the start
    partly = g - left * ca.substitute(g, z, start / unit)
    direct = ca.rootfinder("direct", "fast_newton", {"x": z, "p": others, "g": g}, _NEWTON)
    step = ca.rootfinder(
        "step", "fast_newton", {"x": z, "p": ca.vertcat(others, left), "g": partly}, _NEWTON
    )

    p = ca.MX.sym("p", others.numel())
    first = direct(x0=begin(p), p=p)["x"]
    followed = begin(p)
    for part in np.linspace(1.0, 0.0, _STAGES + 1)[1:]:
        followed = step(x0=followed, p=ca.vertcat(p, part))["x"]
    near = ca.if_else(holds(first, p), first, followed, True)
    last = direct(x0=near, p=p)["x"]  # what it starts from has no derivative
    value = unit * last + ca.if_else(holds(last, p), 0.0, np.nan)
    # As one call: what is inside is neither searched for kinks nor written out again.
    return ca.Function("root", [p], [value], {"never_inline": True})


def _unit(start: ca.SX) -> float:
    """Return what a variable is measured in while it is looked for: the size of its guess."""
    size = abs(float(start)) if start.is_constant() else 0.0
    return size if size > 0.0 and np.isfinite(size) else 1.0


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
