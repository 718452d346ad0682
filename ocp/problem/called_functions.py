"""What goes wrong with functions that a problem calls: kinks, and arguments without a value."""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp.checks.errors import ProblemError
from ocp.expressions.table import has_ends, has_kinks
from ocp.problem.walk import operations

# A trajectory is at the end of a table where there is no value a little further on: by this part of
# the range that the argument has along it.
_REACH = 1e-2


def check_kinks(owner: str, called: Iterable[ca.Function], smoothness: int) -> None:
    """Refuse a table with kinks in a problem that is declared smooth."""
    for function in called:
        if smoothness > 0 and has_kinks(function):
            raise ProblemError(
                f"{owner}: table '{function.name()}' is linear between its knots, where it has "
                f"kinks, but smoothness={smoothness} is declared: declare smoothness=0, or take "
                "Table(..., between='cubic')"
            )


class UndefinedCall(NamedTuple):
    """A function that has no value at its arguments: in words, and at which point that is."""

    said: str
    point: int


def undefined_call(expression: ca.SX, symbols: ca.SX, points: np.ndarray) -> UndefinedCall | None:
    """Return which function has no value at finite arguments, or None.

    Args:
        expression: column.
        symbols: all that it contains, stacked (n,).
        points: their numbers along a trajectory, (k, n); of more than one also what lies a little
            beyond them is looked at in tables that end.
    """
    for node in operations(expression):
        if node.is_call():
            function, inputs = node.which_function(), [node.dep(i) for i in range(node.n_dep())]
            values = ca.Function("given", [symbols], [ca.densify(ca.vertcat(*inputs))])
            given = np.array(values.map(len(points))(points.T)).T
            for point, row in enumerate(given):
                if np.isfinite(row).all() and any(
                    not _is_finite(function, each) for each in _around(function, row, given)
                ):
                    return UndefinedCall(_said(function, row), point)
    return None


def _around(function: ca.Function, row: np.ndarray, given: np.ndarray) -> Iterator[np.ndarray]:
    """Yield arguments, and of a table that ends those a little further on."""
    yield row
    if has_ends(function):
        for reach in np.diag(_REACH * np.nan_to_num(np.ptp(given, axis=0))):
            yield from (row - reach, row + reach)


def _said(function: ca.Function, row: np.ndarray) -> str:
    call = f"{function.name()}({', '.join(f'{value:.6g}' for value in row)})"
    if not has_ends(function):
        return f"the function {call} is not finite"
    return (
        f"table {call} comes to its end: bound what stands in it, or take beyond='extend' or "
        "'clamp'"
    )


def _is_finite(function: ca.Function, given: np.ndarray) -> bool:
    ends = np.cumsum([0, *(function.nnz_in(i) for i in range(function.n_in()))])
    inputs = [
        ca.DM(function.sparsity_in(i), given[first:last])
        for i, (first, last) in enumerate(pairwise(ends))
    ]
    return all(np.isfinite(np.array(value)).all() for value in function.call(inputs))
