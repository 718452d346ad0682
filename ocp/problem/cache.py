"""Keep what is derived from a problem as long as the problem exists."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

from ocp.checks.arguments import check_instance
from ocp.problem.ocp import OCP

T = TypeVar("T")


def once_per_problem(derive: Callable[[OCP], T]) -> Callable[[OCP], T]:
    """Decorate a function of a problem so that it is computed once, and forgotten with it.

    It is kept in the problem itself: what refers to its problem, as the scaled one does, would keep
    it in any dictionary outside, and so itself for ever.
    """

    @wraps(derive)
    def derived(ocp: OCP) -> T:
        try:
            return ocp.derived[derive]
        except (KeyError, AttributeError):  # not yet, or no problem
            check_instance(ocp, OCP, f"{derive.__name__.lstrip('_')}: the problem")
        # Two threads may both derive it; all get the same one.
        return ocp.derived.setdefault(derive, derive(ocp))

    return derived
