"""The largest value along the way, as a cost."""

from collections.abc import Iterable
from dataclasses import dataclass

import casadi as ca

from ocp.checks.arguments import check_instance, check_positive
from ocp.checks.expressions import check_column
from ocp.problem.portable import Portable


@dataclass(frozen=True, eq=False)
class Peak(Portable):
    r"""The largest value of an expression along the way: a term of the cost.

    .. math:: J + w \max_t \max_i g_i(x, u, t)

    So a load, an overshoot or a force is made as small as it can be (min-max, Chebyshev's norm). In
    discrete time the largest value at the steps and, where it contains no control, at the end.

    Args:
        name: what a message calls it, and the key of ``solution.peaks``.
        expression: column (m,) in x, u, t and parameters; the largest row counts. Absolute values
            and maxima at its top, such as ``fabs(force)``, are free of their kinks inside.
        weight: w, positive.

    Raises:
        ProblemError: if the weight is not positive, or the expression no column.
    """

    name: str
    expression: ca.SX
    weight: float = 1.0

    def __post_init__(self) -> None:
        """Stack the expression, check the weight."""
        check_instance(self.name, str, "the name of a Peak")
        expression = check_column(self.expression, f"peak '{self.name}'")
        object.__setattr__(self, "expression", expression)
        check_positive(self.weight, f"peak '{self.name}': weight")

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.expression.numel()

    def rows(self) -> ca.SX:
        """Return rows with the same largest value, without maxima at their top."""
        return ca.vertcat(*_without_maxima(ca.vertsplit(self.expression)))


def _without_maxima(rows: Iterable[ca.SX]) -> list[ca.SX]:
    found: list[ca.SX] = []
    for row in rows:
        match row.op():
            case ca.OP_FABS:
                found += _without_maxima([row.dep(0), -row.dep(0)])
            case ca.OP_FMAX:
                found += _without_maxima([row.dep(0), row.dep(1)])
            case _:
                found.append(row)
    return found
