"""Of what degree is an expression, and which of its terms stops it from being lower?"""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp.checks.expressions import readable


def degrees(expression: ca.SX, variables: ca.SX) -> np.ndarray:
    """Return an upper bound of the polynomial degree of every element, (m,).

    Read off the operations: a sum has the larger degree, a product the sum of both, anything
    that is no polynomial (sine, absolute value, division by a variable) infinity. Derivatives
    would not do: those of an absolute value look like those of a line.

    Args:
        expression: column (m,).
        variables: column; everything else counts as a constant.
    """
    known = {e.element_hash() for e in ca.vertsplit(variables)}
    others = [s for s in ca.symvar(expression) if s.element_hash() not in known]
    function = ca.Function(
        "f", [variables, ca.vertcat(ca.SX(0, 1), *others)], [ca.densify(expression)]
    )
    result = np.zeros(expression.numel())
    degree: dict[int, float] = {}
    constant: dict[int, float] = {}
    for k in range(function.n_instructions()):
        op, outs = function.instruction_id(k), function.instruction_output(k)
        ins = function.instruction_input(k)
        if op == ca.OP_OUTPUT:
            result[outs[1]] = degree[ins[0]]
            continue
        value = constant.get(ins[1]) if len(ins) > 1 and op != ca.OP_INPUT else None
        for out in outs:
            constant.pop(out, None)
        if op == ca.OP_CONST:
            constant[outs[0]], here = function.instruction_constant(k), 0.0
        elif op == ca.OP_INPUT:
            here = 1.0 if ins[0] == 0 else 0.0
        else:
            here = _after(op, [degree[i] for i in ins], value)
        degree.update(dict.fromkeys(outs, here))
    return result


def _after(op: int, of: list[float], exponent: float | None) -> float:
    """Degree of the result of one operation on arguments of these degrees."""
    if not any(of):
        return 0.0
    if op in (ca.OP_ADD, ca.OP_SUB):
        return max(of)
    if op == ca.OP_MUL:
        return sum(of)
    if op in (ca.OP_NEG, ca.OP_TWICE, ca.OP_ASSIGN):
        return of[0]
    if op == ca.OP_SQ:
        return 2.0 * of[0]
    if op == ca.OP_DIV and of[1] == 0.0:
        return of[0]
    if op == ca.OP_IF_ELSE_ZERO and of[0] == 0.0:
        return of[1]
    whole = exponent is not None and exponent >= 1.0 and exponent == int(exponent)
    if op in (ca.OP_POW, ca.OP_CONSTPOW) and whole and of[1] == 0.0:
        return of[0] * float(exponent or 0.0)
    return np.inf


def beyond(expression: ca.SX, x: ca.SX, u: ca.SX, limit: int) -> str | None:
    """Return the variable and the term that make a scalar exceed a degree, or None.

    For example ``"x[0] (sin(x[0]))"``.
    """
    variables = ca.vertcat(x, u)
    if degrees(expression, variables)[0] <= limit:
        return None
    names = [f"x[{i}]" for i in range(x.numel())] + [f"u[{i}]" for i in range(u.numel())]
    labels = ca.vertcat(*[ca.SX.sym(name) for name in names])
    for term in _summands(expression):
        if degrees(term, variables)[0] > limit:
            alone = [degrees(term, variables[i])[0] for i in range(len(names))]
            culprit = int(
                np.argmax(np.array(alone) > limit) if max(alone) > limit else np.argmax(alone)
            )
            return f"{names[culprit]} ({readable(ca.substitute(term, variables, labels))})"
    return names[0]


def _summands(expression: ca.SX) -> Iterator[ca.SX]:
    """Yield the terms of a sum, from left to right."""
    waiting = [expression]
    while waiting:
        term = waiting.pop()
        if term.is_op(ca.OP_ADD) or term.is_op(ca.OP_SUB):
            waiting += [term.dep(1), term.dep(0)]
        elif term.is_op(ca.OP_NEG):
            waiting.append(term.dep(0))
        else:
            yield term
