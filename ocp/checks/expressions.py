"""Checks of CasADi expressions, and expressions as text."""

import re
from collections.abc import Sequence

import casadi as ca
import numpy as np

from ocp.checks.arguments import class_in_words
from ocp.checks.errors import ProblemError
from ocp.checks.scalar_form import scalar_form

Expression = ca.SX | ca.MX | ca.DM | float | int | np.ndarray | Sequence

# An expression longer than this says less than its dimensions do.
_READABLE = 100
# CasADi names what occurs twice, numbers too: "@1=1, (x+(@1-y))".
_NAMED_NUMBER = re.compile(r"(@\d+)=(-?[\d.]+(?:e[-+]?\d+)?), ")


def check_symbols(symbols: ca.SX | ca.MX, what: str) -> ca.SX:
    """Return ``symbols`` as ``SX``, or raise unless they are a column of distinct symbols."""
    if isinstance(symbols, ca.MX):
        symbols = scalar_form(symbols)
    if not isinstance(symbols, ca.SX):
        raise ProblemError(f"{what} is {class_in_words(symbols)}; write it with casadi.SX.sym")
    if symbols.shape[1] != 1 or not symbols.is_dense():
        raise ProblemError(
            f"{what} must be a dense column of symbols, it has shape {symbols.shape}"
        )
    composed = [element for element in ca.vertsplit(symbols) if not element.is_symbolic()]
    if composed:
        raise ProblemError(
            f"{what} must be a dense column of symbols, {composed[0]} is an expression"
        )
    if len({element.element_hash() for element in ca.vertsplit(symbols)}) < symbols.numel():
        raise ProblemError(
            f"{what} contains the same symbol twice: {', '.join(element_names(symbols))}"
        )
    return symbols


def element_names(symbols: ca.SX) -> tuple[str, ...]:
    """Return the name of every scalar symbol in a column."""
    return tuple(str(symbols[i]) for i in range(symbols.numel()))


def check_column(expression: Expression, what: str) -> ca.SX:
    """Return ``expression`` as a dense ``SX`` column; a list is stacked."""
    try:
        if isinstance(expression, list | tuple):
            expression = ca.vertcat(*expression)
        if isinstance(expression, ca.MX):
            expression = scalar_form(expression)
        result = ca.SX(expression)
    except (TypeError, ValueError, NotImplementedError) as error:
        raise ProblemError(
            f"{what} is {class_in_words(expression)} that is no casadi.SX expression"
        ) from error
    if result.shape[1] != 1 and result.shape[0] != 1:
        raise ProblemError(f"{what} has shape {result.shape}, a column is needed")
    return ca.densify(ca.vec(result))


def check_scalar(expression: Expression, what: str) -> ca.SX:
    """Return ``expression`` as a scalar ``SX``."""
    result = check_column(expression, what)
    if result.numel() != 1:
        raise ProblemError(f"{what} has {result.numel()} elements, a scalar is needed")
    return result


def refuse_foreign_symbols(expression: ca.SX, allowed: Sequence[ca.SX], what: str) -> None:
    """Raise ``ProblemError`` naming each symbol of ``expression`` that is not ``allowed``."""
    known = {e.element_hash() for block in allowed for e in ca.vertsplit(ca.vec(block))}
    foreign = [str(s) for s in ca.symvar(expression) if s.element_hash() not in known]
    if not foreign:
        return
    names = {str(e) for block in allowed for e in ca.vertsplit(ca.vec(block))}
    twins = ", ".join(sorted(names.intersection(foreign)))
    said = (
        f"; the {twins} of this problem is another symbol of the same name: made a second time, "
        "or one of MX where the other is of SX; write all terms with the same"
    )
    raise ProblemError(
        f"{what} contains {', '.join(sorted(foreign))}, unknown at this place: "
        "it must be a state, a control, the time given as Model(t=...) or a declared "
        f"parameter (no controls in initial or terminal terms){said * bool(twins)}"
    )


def readable(expression: ca.SX) -> str:
    """Return a short expression in full, and what a long one depends on."""
    text = _with_numbers(str(expression))
    if len(text) <= _READABLE and "@" not in text:
        return text
    symbols = ", ".join(str(s) for s in ca.symvar(expression))
    return f"[{ca.n_nodes(expression)} nodes] of ({symbols})"


def _with_numbers(text: str) -> str:
    """Write numbers that have a name where they occur."""
    values = dict(_NAMED_NUMBER.findall(text))
    return re.sub(r"@\d+", lambda name: values.get(name[0], name[0]), _NAMED_NUMBER.sub("", text))
