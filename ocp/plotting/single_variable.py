"""Which rows of a column are a single variable, but for a factor and what is known beforehand."""

from typing import NamedTuple

import casadi as ca

from ocp.problem.ocp import OCP


class SingleVariable(NamedTuple):
    """A row that is ``slope * variable + rest``, the rest of time and parameters alone.

    Attributes:
        place: which of states, controls and algebraic variables, in this order.
        slope: not zero.
    """

    place: int
    slope: float


def single_variables(ocp: OCP, expression: ca.SX) -> list[SingleVariable | None]:
    """Return for every row of a column (m,) the variable that it is; None where it is none."""
    m = ocp.model
    slopes = ca.jacobian(expression, ca.vertcat(m.x, m.u, m.z))
    found: list[SingleVariable | None] = []
    for i in range(expression.numel()):
        row = slopes[i, :]
        columns = row.sparsity().get_col() if row.nnz() else []
        given = [(k, row[0, k]) for k in columns if not row[0, k].is_zero()]
        is_single = len(given) == 1 and given[0][1].is_constant()
        found.append(SingleVariable(given[0][0], float(given[0][1])) if is_single else None)
    return found
