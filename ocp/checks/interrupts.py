"""Ctrl-C in the middle of compiled code, which CasADi turns into another error."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def raise_interrupt(error: RuntimeError | SystemError) -> None:
    """Raise what a handler of signals has raised, if that is what an error of CasADi hides.

    Where compiled code went on, Python finds a result beside an exception: a ``SystemError`` with
    that cause. Where it ended, CasADi keeps the name alone.

    Raises:
        KeyboardInterrupt: after Ctrl-C; of a ``SystemError`` its cause, whatever it is.
    """
    if isinstance(error, SystemError) and error.__cause__ is not None:
        raise error.__cause__ from None
    if str(error).endswith(KeyboardInterrupt.__name__):
        raise KeyboardInterrupt from None


def interruptible(call: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function that calls CasADi, so that Ctrl-C leaves it as ``KeyboardInterrupt``."""

    @wraps(call)
    def called(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return call(*args, **kwargs)
        except (RuntimeError, SystemError) as error:
            raise_interrupt(error)
            raise

    return called
