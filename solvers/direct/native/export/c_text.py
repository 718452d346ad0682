"""Numbers as C: arrays, tables of weights, names."""

import re
from collections.abc import Sequence

import numpy as np

from ocp import ProblemError

_KEYWORDS = frozenset(
    [
        "auto",
        "break",
        "case",
        "char",
        "const",
        "continue",
        "default",
        "do",
        "double",
        "else",
        "enum",
        "extern",
        "float",
        "for",
        "goto",
        "if",
        "inline",
        "int",
        "long",
        "register",
        "restrict",
        "return",
        "short",
        "signed",
        "sizeof",
        "static",
        "struct",
        "switch",
        "typedef",
        "union",
        "unsigned",
        "void",
        "volatile",
        "while",
        "main",
    ]
)
# Numbers a line.
_LINE = 8


def numbers(name: str, values: np.ndarray) -> str:
    """Return an array of doubles; one without numbers has a zero that nobody reads."""
    words = [number(value) for value in np.ravel(values).tolist()] or ["0.0"]
    return _array(f"static const double {name}[]", words)


def whole_numbers(name: str, values: np.ndarray) -> str:
    """Return an array of whole numbers."""
    return _array(f"static const int {name}[]", [str(int(v)) for v in values] or ["0"])


def terms(name: str, found: Sequence[tuple[int, int, float]]) -> str:
    """Return a table of (row, column, weight), and how many there are."""
    words = [f"{{{row}, {column}, {number(w)}}}" for row, column, w in found]
    table = _array(f"static const Term {name}[]", words or ["{0, 0, 0.0}"])
    return f"#define {name}_count {len(found)}\n{table}"


def affine(
    name: str, constants: np.ndarray, found: Sequence[tuple[int, int, float]]
) -> tuple[str, str]:
    """Return constants and weights of an affine function of the parameters."""
    return numbers(f"{name}_constants", constants), terms(f"{name}_of_parameters", found)


def number(value: float) -> str:
    """Return a double that is read back as it is."""
    if value != value:
        return "NAN"
    if abs(value) == float("inf"):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return repr(value)


def check_name(name: str) -> str:
    """Return a prefix of C names.

    Raises:
        ProblemError: if it is none.
    """
    is_name = isinstance(name, str) and re.fullmatch("[a-z][a-z0-9_]*", name)
    if not is_name or name in _KEYWORDS:
        raise ProblemError(
            f"export_c: name = {name!r} must be a name in C: small letters, digits and "
            "underscores, a letter first, and no word of C"
        )
    return name


def _array(head: str, words: list[str]) -> str:
    lines = [", ".join(words[i : i + _LINE]) for i in range(0, len(words), _LINE)]
    return f"{head} = {{\n  " + ",\n  ".join(lines) + "};"
