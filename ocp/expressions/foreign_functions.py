"""Functions whose code is not here: of a library that was loaded, or of Python."""

from collections.abc import Iterable, Iterator

import casadi as ca

# As CasADi calls what it loads from a library, and what calls back into Python.
_EXTERNAL, _CALLBACK = "External", "CallbackInternal"


def external(called: Iterable[ca.Function]) -> list[ca.Function]:
    """Return those whose code is not here."""
    return [f for f in called if f.class_name() in (_EXTERNAL, _CALLBACK)]


def callbacks(called: Iterable[ca.Function]) -> list[ca.Function]:
    """Return those that call back into Python."""
    return [f for f in called if f.class_name() == _CALLBACK]


def without_derivatives(called: Iterable[ca.Function], order: int) -> Iterator[ca.Function]:
    """Yield what cannot be differentiated so often, at most twice."""
    for function in external(called):
        try:
            slope = function.reverse(1) if order > 0 else function
            if order > 1:
                slope.forward(1)
        except RuntimeError:  # what CasADi raises where there is none
            yield function
