"""Keep what is derived from a problem as long as the problem exists."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from ocp.checks.arguments import check_instance
from ocp.problem.ocp import OCP

T = TypeVar("T")


def once_per_problem(derive: Callable[[OCP], T]) -> Callable[[OCP], T]:
    """Decorate a function of a problem so that it is computed once, and forgotten with it."""
    kept: WeakKeyDictionary[OCP, T] = WeakKeyDictionary()

    @wraps(derive)
    def derived(ocp: OCP) -> T:
        try:
            return kept[ocp]
        except (KeyError, TypeError):  # not yet, or no problem: then there may be no key of it
            check_instance(ocp, OCP, f"{derive.__name__.lstrip('_')}: the problem")
        # Two threads may both derive it; all get the same one.
        return kept.setdefault(ocp, derive(ocp))

    return derived
