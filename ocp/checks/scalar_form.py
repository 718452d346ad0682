"""Expressions of MX written in SX: a problem has one description, whatever it is written in."""

import casadi as ca

# Every symbol of MX that was met, and the same in SX. Both are kept: who makes a constraint today
# and another tomorrow means the same symbol. The key is the address of CasADi's node, which
# nothing else can take while the symbol is kept.
_known: dict[int, tuple[ca.MX, ca.SX]] = {}


def scalar_form(expression: ca.MX) -> ca.SX:
    """Return an expression of MX in SX, operation by operation.

    A symbol becomes, in every expression alike, symbols of the same name, ``x_0, x_1, ...`` where
    it has several entries. What cannot be written in scalars (a root finder, an interpolant, an
    external function, a callback) is called from there, with its exact derivatives.
    """
    symbols = ca.symvar(expression)
    scalars = [_scalars(symbol) for symbol in symbols]
    try:
        return ca.Function("written", symbols, [expression]).call(scalars)[0]
    except RuntimeError:  # an operation on matrices without a scalar form, such as ca.solve
        whole = ca.Function("written", symbols, [expression], {"never_inline": True})
        return whole.call(scalars)[0]


def _scalars(symbol: ca.MX) -> ca.SX:
    twin = symbol, ca.SX.sym(symbol.name(), symbol.sparsity())
    return _known.setdefault(hash(symbol), twin)[1]
