"""Checks of what a user gives, in words that name what is wrong."""

from collections.abc import Iterable
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.errors import ProblemError

# More stages, steps or iterations than this are a mistake; larger numbers overflow elsewhere.
_MOST = 2**31 - 1


def check_numeric(values: ArrayLike, what: str) -> np.ndarray:
    """Return ``values`` as a new float array, or raise ``ProblemError``.

    Text, truth values, complex numbers and arrays with masked entries are refused: NumPy would
    convert some of them silently.
    """
    if type(values) is np.ndarray and values.dtype == float:  # nothing to look for
        return values.copy()
    if np.ma.is_masked(values):
        raise ProblemError(f"{what} has masked entries; fill or leave them out")
    try:
        given = np.asarray(values)
        numeric = given.dtype.kind in "fiu" or (given.dtype.kind == "O" and not _has_other(given))
        # NumPy makes 1 of a True beside numbers: a list is looked through.
        if numeric and not (isinstance(values, list | tuple) and _has_other(_flat(values))):
            return np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise ProblemError(f"{what} is not numeric: {_shown(values)}") from error
    raise ProblemError(f"{what} is not numeric: {_shown(values)}")


def _has_other(values: np.ndarray) -> bool:
    """Whether an array of objects holds a truth value or a text."""
    return any(isinstance(v, bool | np.bool_ | str | bytes | complex) for v in values.flat)


def _flat(values: list | tuple) -> np.ndarray:
    """Return the numbers of nested lists as they are, as an array of objects."""
    found: list[object] = []
    for value in values:
        found.extend(_flat(value) if isinstance(value, list | tuple) else [value])
    flat = np.empty(len(found), dtype=object)
    flat[:] = found
    return flat


def _shown(value: object) -> str:
    """Return a value as a message shows it: Python refuses to write very long numbers."""
    if isinstance(value, int) and abs(value) > 10**20:
        return "a number that is too large"
    try:
        text = repr(value)
    except ValueError:
        return "a number that is too large"
    return text if len(text) <= 200 else f"{text[:200]}..."


def check_whole(value: object, what: str, *, least: int = 1) -> int:
    """Return ``value`` if it is a whole number of at least ``least``.

    Args:
        value: what a user gave.
        what: how a message calls it.
        least: smallest number allowed.

    Raises:
        ProblemError: otherwise, and for a bool or a float, naming ``what``.
    """
    number = least - 1
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        number = int(value)
    if not least <= number <= _MOST:
        raise ProblemError(
            f"{what} must be a whole number of at least {least}, not {_shown(value)}"
        )
    return number


def check_choice(value: object, choices: Iterable[str], what: str) -> None:
    """Check that ``value`` is one of some words, or raise ``ProblemError``."""
    known = list(choices)
    if not isinstance(value, str) or value not in known:
        *others, last = known
        said = (
            f"neither {' nor '.join(known)}"
            if len(known) == 2
            else (f"none of {', '.join(others)} and {last}")
        )
        raise ProblemError(f"{what} = {_shown(value)} is {said}")


def check_flag(value: object, what: str) -> bool:
    """Return ``value`` if it is True or False, or raise ``ProblemError``."""
    if not isinstance(value, bool | np.bool_):
        raise ProblemError(f"{what} is {_shown(value)}, True or False is needed")
    return bool(value)


def check_positive(
    value: object, what: str, *, finite: bool = True, below: float = np.inf
) -> float:
    """Return ``value`` if it is one positive number, or raise ``ProblemError``.

    Args:
        value: what should be a number.
        what: how a message calls it.
        finite: whether infinity is refused.
        below: limit that a finite number must not reach.
    """
    number = _number(value, finite, below)
    if not number > 0.0:
        raise ProblemError(f"{what} = {_shown(value)}, it must be positive{_limit(finite, below)}")
    return number


def check_not_negative(
    value: object, what: str, *, finite: bool = True, below: float = np.inf
) -> float:
    """Return ``value`` if it is one number, 0 or more; else as ``positive``."""
    number = _number(value, finite, below)
    if not number >= 0.0:
        raise ProblemError(f"{what} = {_shown(value)}, it must be 0 or more{_limit(finite, below)}")
    return number


def check_real(value: object, what: str) -> float:
    """Return ``value`` if it is one finite number; else as ``positive``."""
    number = _number(value, True, np.inf)
    if not number > -np.inf:
        raise ProblemError(f"{what} = {_shown(value)}, a finite number is needed")
    return number


def _number(value: object, finite: bool, below: float) -> float:
    """Return one number below a limit as it is, anything else as NaN."""
    is_number = isinstance(value, int | float | np.integer | np.floating)
    if not is_number or isinstance(value, bool):
        return np.nan
    try:
        number = float(value)
    except OverflowError:  # an integer beyond all floats
        return np.nan
    return number if number < below or (number == np.inf and not finite) else np.nan


def _limit(finite: bool, below: float) -> str:
    return f", below {below:g}" if below < np.inf else ", finite" * finite


def check_instance(value: object, kind: type | tuple[type, ...], what: str) -> None:
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
        raise ProblemError(
            f"{what} is {class_in_words(value)}, {names} is needed{_hint(value, kinds)}"
        )


def check_callable(value: object, what: str) -> None:
    """Check that ``value`` can be called, or raise ``ProblemError`` as ``instance`` does."""
    if isinstance(value, type) or not callable(value):
        raise ProblemError(f"{what} is {class_in_words(value)}, a function is needed")


def class_in_words(value: object) -> str:
    """Return the class of a value, with its article."""
    if isinstance(value, type):
        return f"the class {value.__name__}"
    name = type(value).__name__
    return f"{'an' if name[0] in 'AEIOUaeiou' or name in ('MX', 'SX') else 'a'} {name}"


def _hint(value: object, kinds: tuple[type, ...]) -> str:
    """Return what was probably meant: an instance of a class, the solution inside a result."""
    if isinstance(value, type):
        return f": write {value.__name__}(...)" if {*kinds} & {*value.__mro__} else ""
    return ": its .solution is one" if isinstance(getattr(value, "solution", None), kinds) else ""


def check_numbers(
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
    vector = check_numeric(values, what)
    if repeat and vector.ndim == 0:
        vector = np.full(size, float(vector))
    vector = vector.reshape(-1)
    if vector.size != size:
        raise ProblemError(f"{what} has {vector.size} entries, {size} are needed")
    # Where the sum of squares is finite all are: what each run asks for has a quick answer.
    if not isfinite(np.vdot(vector, vector)):
        _refuse_wrong(vector, what, finite=finite)
    vector.flags.writeable = False
    return vector


def _refuse_wrong(vector: np.ndarray, what: str, *, finite: bool) -> None:
    """Refuse NaN, and infinity where ``finite``."""
    wrong = np.flatnonzero(~np.isfinite(vector) if finite else np.isnan(vector))
    if wrong.size:
        needed = "a finite number" if finite else "a number"
        raise ProblemError(f"{what}[{wrong[0]}] is {vector[wrong[0]]}, {needed} is needed")


def check_nominal(values: ArrayLike | None, size: int, what: str) -> np.ndarray | None:
    """Return nominal sizes as a read-only vector (size,), or None where none are given.

    Raises:
        ProblemError: on a wrong number of them, or one that is not positive and finite.
    """
    if values is None:
        return None
    vector = check_numbers(values, size, what)
    wrong = np.flatnonzero(vector <= 0.0)
    if wrong.size:
        raise ProblemError(f"{what}[{wrong[0]}] is {vector[wrong[0]]}, a positive size is needed")
    return vector
