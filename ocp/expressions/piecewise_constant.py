"""A decision in an expression, such as which features of two bodies are nearest.

Its value is constant wherever it does not jump. What is made of it may be continuous all the same,
and differentiable: a distance is, where the features change that it is measured between.
"""

from typing import Any

import casadi as ca
import numpy as np

# How the value is called in its Function: so an expression says what it is made of.
_CHOICE = "choice"
# A slope that changes no value, and whose square is zero.
_HARDLY = 1e-200
# What is smaller comes of that slope, times any weight; no derivative of a problem is that small.
_TRACE = 1e-100


def piecewise_constant(name: str, given: Any, choice: Any) -> ca.Function:
    """Return a call node (n,) -> (m,) for what is constant wherever it does not jump.

    Its derivatives are as good as zero and cost nothing, also where CasADi would not see that
    they vanish. As good as zero, not zero: of a call without any derivative CasADi (3.8.2) loses
    the value in second derivatives. What is inside is not searched for jumps.

    Args:
        name: of the function.
        given: its argument, a column of symbols of SX or MX.
        choice: what it returns, a column.
    """
    # Declared for inputs alone: with outputs as well, derivatives of SX are NaN.
    options = {"never_inline": True, "is_diff_in": [False]}
    decide = ca.Function(f"decide_{name}", [given], [ca.densify(choice)], options)
    x = type(given).sym("x", given.numel())
    value = decide(x) + _HARDLY * ca.sum1(x)
    return ca.Function(name, [x], [value], ["x"], [_CHOICE], {"never_inline": True})


def deciding(node: ca.SX) -> ca.Function | None:
    """Return the decision of which a node of an expression is a value, or None."""
    if not node.is_output():
        return None
    function = node.dep(0).which_function()
    return function if function.name_out(0) == _CHOICE else None


def without_traces(values: np.ndarray) -> np.ndarray:
    """Return numbers with 0 in place of what is left of a decision's derivative.

    To be asked of derivatives before it is asked whether they are zero, or how large they are
    against each other.
    """
    return np.where(np.abs(values) < _TRACE, 0.0, values)
