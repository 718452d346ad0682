"""Copies and pickles of descriptions: their fields travel, and what is the same symbol stays so.

A CasADi symbol is what it is by identity: two of the same name are different. In a pickle, all
expressions of a problem are one Function of their symbols, which keeps what they have in common,
and every symbol is an object of its own, which a pickler writes once however often it comes. So
all that is pickled together, such as a problem and its solutions, or a tuple of a constraint and
its model, shares its symbols; what is pickled alone has new ones of the same names.
"""

from collections.abc import Callable
from functools import cached_property
from operator import getitem
from threading import Lock
from typing import Any, Self
from weakref import WeakValueDictionary

import casadi as ca
import numpy as np

from ocp.checks.errors import ProblemError
from ocp.expressions.foreign_functions import callbacks


class Portable:
    """Base of frozen dataclasses that may hold ``SX``: copied, and pickled, by their fields.

    What was derived is not taken along. A shallow copy is the object itself. A deep copy has
    arrays of its own and the same symbols, so that it goes with the original's expressions.
    """

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled."""
        together = _Written(self.expressions())
        fields = without_caches(self)
        return {k: _Entry.of(v, together) if isinstance(v, ca.SX) else v for k, v in fields.items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take it; arrays are read-only again."""
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        vars(self).update(state)

    def __copy__(self) -> Self:
        return self

    def expressions(self) -> list[ca.SX]:
        """Return all expressions that are pickled as one: those of the object, and of its parts."""
        return [value for value in without_caches(self).values() if isinstance(value, ca.SX)]


def without_caches(owner: object) -> dict[str, Any]:
    """Return the attributes of an object, without what its cached properties keep."""
    kind = type(owner)
    return {
        name: value
        for name, value in vars(owner).items()
        if not isinstance(getattr(kind, name, None), cached_property)
    }


class _Written:
    """Expressions in a pickle."""

    def __init__(self, values: list[ca.SX]) -> None:
        self.values = values
        for value in values:
            _expressions.setdefault(id(value), self)

    def __reduce__(self) -> tuple[Callable[..., list[ca.SX]], tuple[str, list["_Symbol"]]]:
        symbols = ca.symvar(ca.veccat(*self.values))
        inputs = [ca.vertcat(ca.SX(0, 1), *symbols)]
        function = ca.Function("expressions", inputs, self.values)
        for called in callbacks(function.find_functions()):
            raise ProblemError(
                f"no pickle takes what calls '{called.name()}', a Python callback: it belongs to "
                "this process; take a Table or an external function"
            )
        return _read, (function.serialize(), [_Symbol.of(symbol) for symbol in symbols])


class _Entry:
    """One of them."""

    def __init__(self, written: _Written, index: int) -> None:
        self.written, self.index = written, index

    @classmethod
    def of(cls, value: ca.SX, together: _Written) -> Self:
        """Return it as a part of what it was first written with."""
        written = _expressions.get(id(value), together)
        return cls(written, [id(each) for each in written.values].index(id(value)))

    def __reduce__(self) -> tuple[Callable[..., ca.SX], tuple[_Written, int]]:
        return getitem, (self.written, self.index)

    def __deepcopy__(self, memo: dict[int, object]) -> ca.SX:
        return self.written.values[self.index]  # it never changes


class _Symbol:
    """A symbol in a pickle, the same object wherever the symbol occurs."""

    def __init__(self, value: ca.SX) -> None:
        self.value = value

    @classmethod
    def of(cls, value: ca.SX) -> "_Symbol":
        """Return that object."""
        with _lock:
            return _symbols.setdefault(value.element_hash(), cls(value))

    def __reduce__(self) -> tuple[Callable[..., ca.SX], tuple[str]]:
        return _symbol, (self.value.name(),)


# What is being pickled: a pickler keeps what it has written until it ends.
_expressions: WeakValueDictionary[int, _Written] = WeakValueDictionary()
_symbols: WeakValueDictionary[int, _Symbol] = WeakValueDictionary()
_lock = Lock()


def _symbol(name: str) -> ca.SX:
    return ca.SX.sym(name)


def _read(text: str, symbols: list[ca.SX]) -> list[ca.SX]:
    return ca.Function.deserialize(text).call([ca.vertcat(ca.SX(0, 1), *symbols)])
