"""An expression evaluated operation by operation, with operations of one's own."""

from collections.abc import Callable
from typing import TypeVar

import casadi as ca

T = TypeVar("T")


def walk(
    expression: ca.SX,
    symbols: ca.SX,
    leaf: Callable[[ca.SX], T],
    node: Callable[[int, int, list[T]], T],
) -> T:
    """Return what a scalar expression becomes when its operations are replaced.

    Args:
        expression: scalar.
        symbols: all that it contains, stacked.
        leaf: what a symbol or a number becomes.
        node: (place, operation, arguments) -> what one operation becomes; the operation is one of
            CasADi's ``OP_...``, its place the number of the instruction.
    """
    function = ca.Function("walked", [symbols], [expression])
    work: dict[int, T] = {}
    found = leaf(ca.SX(0))
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        at, to = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_CONST:
            work[to[0]] = leaf(ca.SX(function.instruction_constant(k)))
        elif operation == ca.OP_INPUT:
            work[to[0]] = leaf(symbols[at[1]])
        elif operation == ca.OP_OUTPUT:
            found = work[at[0]]
        else:
            work[to[0]] = node(k, operation, [work[i] for i in at])
    return found


def applied(operation: int, arguments: list[ca.SX]) -> ca.SX:
    """Return one of CasADi's operations of one or two arguments."""
    if len(arguments) == 1:
        return ca.SX.unary(operation, arguments[0])
    return ca.SX.binary(operation, *arguments)
