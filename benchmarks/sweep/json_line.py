"""A row as one line of JSON with its checksum, and what a line must be to become a row again."""

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from types import UnionType
from typing import TYPE_CHECKING, Any, get_args, get_origin

from ocp.internal import with_checksum, without_checksum

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def line_of(row: "DataclassInstance") -> str:
    """Return a row as it is written."""
    return json.dumps(with_checksum(asdict(row)), allow_nan=False) + "\n"


def entry_of(line: str) -> dict[str, Any]:
    """Read the object of a line; one of an earlier version has no checksum.

    Raises:
        ValueError: if it is none, or not as it was written, saying why.
    """
    try:
        entry = json.loads(line, parse_constant=_no_number)
    except RecursionError as deep:
        raise ValueError("nested too deeply") from deep
    if not isinstance(entry, dict):
        raise ValueError(f"a {type(entry).__name__}, no object")
    return without_checksum(entry)


def check_types(entry: Mapping[str, Any], hints: Mapping[str, Any]) -> None:
    """Compare an object with the types of a row's fields, all of which it has.

    Raises:
        ValueError: for the first that does not fit.
    """
    for name, hint in hints.items():
        if not _fits(entry[name], hint):
            raise ValueError(f"its {name} is {entry[name]!r}")


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number")


def _fits(value: object, hint: Any) -> bool:
    """Whether a value that JSON knows is what a field of a row wants."""
    if isinstance(hint, UnionType):
        return any(_fits(value, one) for one in get_args(hint))
    if get_origin(hint) is dict:
        _, kind = get_args(hint)
        return isinstance(value, dict) and all(
            _is_text(name) and _fits(entry, kind) for name, entry in value.items()
        )
    if get_origin(hint) is tuple:
        kinds = get_args(hint)
        return (
            isinstance(value, list) and len(value) == len(kinds) and all(map(_fits, value, kinds))
        )
    if hint in (int, float):
        return _is_number(value) and (hint is float or isinstance(value, int))
    return isinstance(value, hint) and (hint is not str or _is_text(value))


def _is_number(value: object) -> bool:
    """Whether it is a number that a float can be; JSON knows larger ones."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def _is_text(value: object) -> bool:
    """Whether it can be written: JSON knows halves of characters."""
    return not any("\ud800" <= letter <= "\udfff" for letter in str(value))
