"""The operations of an expression: all of them, or replaced by operations of one's own."""

from collections.abc import Callable, Iterator
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
        leaf: what a symbol, a number, or a value of a called function becomes, such as that of a
            table: in the arguments of a call nothing is replaced.
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
        elif operation == ca.OP_CALL:
            call = function.instructions_sx()[k]
            work.update({place: leaf(call.get_output(i)) for i, place in enumerate(to)})
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


def operations(expression: ca.SX) -> Iterator[ca.SX]:
    """Yield every operation in an expression once."""
    seen: set[int] = set()
    stack = ca.vertsplit(expression)
    while stack:
        node = stack.pop()
        if node.is_constant() or node.is_symbolic() or node.element_hash() in seen:
            continue
        seen.add(node.element_hash())
        yield node
        stack.extend(node.dep(i) for i in range(node.n_dep()))
