"""A method of an object that it does not keep alive."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar
from weakref import WeakMethod

P = ParamSpec("P")
T = TypeVar("T")


def weak_method(method: Callable[P, T]) -> Callable[P, T]:
    """Return a bound method for a part of its own object.

    An object whose parts keep it alive ends some time after it is dropped, when the garbage
    collector finds it; one without such a circle at once, and the processes of its parts with it.
    """
    found = WeakMethod(method)

    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        bound = found()
        assert bound is not None, "only a part of the object calls it"
        return bound(*args, **kwargs)

    return call
