"""Ctrl-C in the middle of compiled code: CasADi makes another error of it, or forgets it."""

import signal
from collections.abc import Callable
from functools import wraps
from threading import current_thread, main_thread
from types import FrameType
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
    """Decorate a function that calls CasADi, so that Ctrl-C leaves it as ``KeyboardInterrupt``.

    When CasADi converts its arguments it clears whatever exception is on its way. So the main
    thread, the only one that Python's handlers run in, notes what the handler of Ctrl-C raises.
    That takes 20 us: what calls no CasADi does without.
    """

    @wraps(call)
    def called(*args: P.args, **kwargs: P.kwargs) -> T:
        handler = signal.getsignal(signal.SIGINT)
        if not callable(handler) or current_thread() is not main_thread():
            return call(*args, **kwargs)
        raised: list[KeyboardInterrupt] = []

        def noted(number: int, frame: FrameType | None) -> None:
            try:
                handler(number, frame)
            except KeyboardInterrupt as interrupt:
                raised.append(interrupt)
                raise

        signal.signal(signal.SIGINT, noted)
        try:
            return call(*args, **kwargs)
        finally:
            signal.signal(signal.SIGINT, handler)
            if raised:
                raise raised[0]

    return called
