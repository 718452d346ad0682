"""What is derived from a problem is kept as long as the problem is."""

from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, TypeVar
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from ocp.problem import OCP

T = TypeVar("T")


def once_per_problem(derive: "Callable[[OCP], T]") -> "Callable[[OCP], T]":
    """Decorate a function of a problem so that it is computed once, and forgotten with it."""
    kept: WeakKeyDictionary[OCP, T] = WeakKeyDictionary()

    @wraps(derive)
    def derived(ocp: "OCP") -> T:
        found = kept.get(ocp)
        if found is None:
            found = kept[ocp] = derive(ocp)
        return found

    return derived
