"""Checks on CasADi expressions and on what a user gives, in words that name what is wrong."""

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.errors import ProblemError

Expression = ca.SX | ca.DM | float | int | np.ndarray | Sequence


def require_symbols(symbols: ca.SX, what: str) -> None:
    """Raise unless ``symbols`` is a column of distinct ``SX`` symbols."""
    if not isinstance(symbols, ca.SX):
        raise ProblemError(f"{what} is {_named(symbols)}; write it with casadi.SX.sym")
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


def element_names(symbols: ca.SX) -> tuple[str, ...]:
    """Return the name of every scalar symbol in a column."""
    return tuple(str(symbols[i]) for i in range(symbols.numel()))


def column(expression: Expression, what: str) -> ca.SX:
    """Return ``expression`` as a dense ``SX`` column; a list is stacked."""
    try:
        if isinstance(expression, list | tuple):
            expression = ca.vertcat(*expression)
        result = ca.SX(expression)
    except (TypeError, ValueError, NotImplementedError) as error:
        raise ProblemError(
            f"{what} is {_named(expression)} that is no casadi.SX expression"
        ) from error
    if result.shape[1] != 1 and result.shape[0] != 1:
        raise ProblemError(f"{what} has shape {result.shape}, a column is needed")
    return ca.densify(ca.vec(result))


def scalar(expression: Expression, what: str) -> ca.SX:
    """Return ``expression`` as a scalar ``SX``."""
    result = column(expression, what)
    if result.numel() != 1:
        raise ProblemError(f"{what} has {result.numel()} elements, a scalar is needed")
    return result


def refuse_foreign_symbols(expression: ca.SX, allowed: Sequence[ca.SX], what: str) -> None:
    """Raise ``ProblemError`` naming each symbol of ``expression`` that is not ``allowed``."""
    known = {e.element_hash() for block in allowed for e in ca.vertsplit(ca.vec(block))}
    foreign = [str(s) for s in ca.symvar(expression) if s.element_hash() not in known]
    if foreign:
        raise ProblemError(
            f"{what} contains {', '.join(sorted(foreign))}, unknown at this place: "
            "it must be a state, a control, the time given as Model(t=...) or a declared "
            "parameter (no controls in initial or terminal terms)"
        )


def numeric(values: ArrayLike, what: str) -> np.ndarray:
    """Return ``values`` as a new float array, or raise ``ProblemError``."""
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise ProblemError(f"{what} is not numeric: {values!r}") from error


def whole(value: object, what: str, *, least: int = 1) -> int:
    """Return ``value`` if it is a whole number of at least ``least``.

    Args:
        value: what a user gave.
        what: how a message calls it.
        least: smallest number allowed.

    Raises:
        ProblemError: otherwise, and for a bool or a float, naming ``what``.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ProblemError(f"{what} must be a whole number of at least {least}, not {value!r}")
    return int(value)


def positive(value: object, what: str, *, finite: bool = True, below: float = np.inf) -> float:
    """Return ``value`` if it is one positive number, or raise ``ProblemError``.

    Args:
        value: what should be a number.
        what: how a message calls it.
        finite: whether infinity is refused.
        below: limit that a finite number must not reach.
    """
    number = _number(value, finite, below)
    if not number > 0.0:
        raise ProblemError(f"{what} = {value!r}, it must be positive{_limit(finite, below)}")
    return number


def not_negative(value: object, what: str, *, finite: bool = True, below: float = np.inf) -> float:
    """Return ``value`` if it is one number, 0 or more; else as ``positive``."""
    number = _number(value, finite, below)
    if not number >= 0.0:
        raise ProblemError(f"{what} = {value!r}, it must be 0 or more{_limit(finite, below)}")
    return number


def real(value: object, what: str) -> float:
    """Return ``value`` if it is one finite number; else as ``positive``."""
    number = _number(value, True, np.inf)
    if not number > -np.inf:
        raise ProblemError(f"{what} = {value!r}, a finite number is needed")
    return number


def _number(value: object, finite: bool, below: float) -> float:
    """Return one number below a limit as it is, anything else as NaN."""
    is_number = isinstance(value, int | float | np.integer | np.floating)
    number = float(value) if is_number and not isinstance(value, bool) else np.nan
    return number if number < below or (number == np.inf and not finite) else np.nan


def _limit(finite: bool, below: float) -> str:
    return f", below {below:g}" if below < np.inf else ", finite" * finite


def instance(value: object, kind: type | tuple[type, ...], what: str) -> None:
    """Check that ``value`` is of a kind.

    Args:
        value: what a user gave.
        kind: class, or classes, that it may be of.
        what: how a message calls it.

    Raises:
        ProblemError: otherwise, naming ``what``, its class and those allowed.
    """
    # A class has what its instances have: to a protocol it looks like one of them.
    if isinstance(value, type) or not isinstance(value, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        names = " or ".join(k.__name__ for k in kinds)
        raise ProblemError(f"{what} is {_named(value)}, {names} is needed{_hint(value, kinds)}")


def function(value: object, what: str) -> None:
    """Check that ``value`` can be called, or raise ``ProblemError`` as ``instance`` does."""
    if isinstance(value, type) or not callable(value):
        raise ProblemError(f"{what} is {_named(value)}, a function is needed")


def _named(value: object) -> str:
    if isinstance(value, type):
        return f"the class {value.__name__}"
    name = type(value).__name__
    return f"{'an' if name[0] in 'AEIOUaeiou' or name in ('MX', 'SX') else 'a'} {name}"


def _hint(value: object, kinds: tuple[type, ...]) -> str:
    """Return what was probably meant: an instance of a class, the solution inside a result."""
    if isinstance(value, type):
        return f": write {value.__name__}(...)" if {*kinds} & {*value.__mro__} else ""
    return ": its .solution is one" if isinstance(getattr(value, "solution", None), kinds) else ""


def numbers(
    values: ArrayLike, size: int, what: str, *, finite: bool = True, repeat: bool = True
) -> np.ndarray:
    """Return ``values`` as a read-only float vector (size,).

    Args:
        values: numbers.
        size: how many are needed.
        what: how a message calls them.
        finite: whether infinity is refused as well as NaN.
        repeat: whether one number stands for all.

    Raises:
        ProblemError: on a wrong size, on NaN, and on infinity where ``finite``.
    """
    vector = numeric(values, what)
    if repeat and vector.ndim == 0:
        vector = np.full(size, float(vector))
    vector = vector.reshape(-1)
    if vector.size != size:
        raise ProblemError(f"{what} has {vector.size} entries, {size} are needed")
    wrong = np.flatnonzero(~np.isfinite(vector) if finite else np.isnan(vector))
    if wrong.size:
        needed = "a finite number" if finite else "a number"
        raise ProblemError(f"{what}[{wrong[0]}] is {vector[wrong[0]]}, {needed} is needed")
    vector.flags.writeable = False
    return vector
