"""Reading expressions: which symbols appear, which operations, with what arguments."""

from collections.abc import Iterator

import casadi as ca

from ocp import OCP


def symbols(ocp: OCP) -> dict[int, str]:
    """Return every symbol of a problem by its hash, with the name a person knows.

    A component of a parameter or signal goes by the name of its entry.
    """
    m = ocp.model
    named = [(e, str(e)) for block in (m.x, m.u, m.t) for e in ca.vertsplit(block)]
    named += [(e, p.name) for p in ocp.parameters for e in ca.vertsplit(p.symbol)]
    return {e.element_hash(): name for e, name in named}


def appearing(ocp: OCP, expression: ca.SX, *, written: bool = False) -> tuple[str, ...]:
    """Return the names of the symbols in an expression, each once.

    Args:
        ocp: the problem.
        expression: of it.
        written: after the name of a parameter or signal also that of its symbol, which is what
            the expression shows.
    """
    known, found = symbols(ocp), []
    for symbol in ca.symvar(expression):
        found.append(known.get(symbol.element_hash(), str(symbol)))
        if written:
            found.append(str(symbol))
    return tuple(dict.fromkeys(found))


def depends(expression: ca.SX, block: ca.SX) -> bool:
    """Whether any element of an expression depends on any symbol of a block."""
    return bool(expression.numel()) and bool(ca.depends_on(expression, block))


def operations(expression: ca.SX) -> Iterator[ca.SX]:
    """Yield every operation in an expression once, arguments before what uses them."""
    seen: set[int] = set()
    stack = [(e, False) for e in ca.vertsplit(ca.densify(ca.vec(expression)))]
    while stack:
        element, done = stack.pop()
        if done:
            yield element
            continue
        key = element.element_hash()
        if key in seen or element.is_constant() or element.is_symbolic():
            continue
        seen.add(key)
        stack.append((element, True))
        stack.extend((element.dep(i), False) for i in range(element.n_dep()))


def shown(expression: ca.SX, longest: int = 60) -> str:
    """Return an expression as text that fits in a sentence."""
    text = str(expression).replace("@", "_")
    return text if len(text) <= longest else f"{text[:longest]}..."


def all_terms(ocp: OCP) -> ca.SX:
    """Return dynamics, costs, constraints and invariants of a problem as one column."""
    rows = [c.expression for c in (*ocp.constraints, *ocp.invariants)]
    return ca.vertcat(ocp.model.f, ca.SX(ocp.running_cost), ca.SX(ocp.terminal_cost), *rows)
