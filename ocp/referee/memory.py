"""What the referee found lately: nobody pays twice for the same trajectory."""

from collections import OrderedDict
from collections.abc import Callable
from threading import Lock
from typing import TypeVar

from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.solution.solution import Solution

T = TypeVar("T")

# Evaluations kept for each problem.
_KEPT = 16


def remembered(
    judge: Callable[[Solution, float], T],
) -> Callable[[Solution, float], T]:
    """Decorate a function of a solution and a tolerance so that its latest results are kept.

    They are found by the solution's numbers, so that a copy with another status, message or time
    finds them as well, and one whose arrays were changed does not.
    """

    def empty(ocp: OCP) -> OrderedDict[tuple, T]:
        return OrderedDict()

    kept, lock = once_per_problem(empty), Lock()

    def found(solution: Solution, tolerance: float) -> T:
        results, key = kept(solution.problem), _numbers(solution, tolerance)
        with lock:
            if key in results:
                results.move_to_end(key)
                return results[key]
        judged = judge(solution, tolerance)  # takes long: other threads need not wait for it
        with lock:
            results[key] = judged
            if len(results) > _KEPT:
                results.popitem(last=False)
        return judged

    return found


def _numbers(solution: Solution, tolerance: float) -> tuple:
    """Return everything that a verdict depends on, as a key."""
    s = solution
    arrays = (s.t, s.x, s.x0, s.costate, s.u, s.breaks)
    given = (value.tobytes() for value in s.data.values.values)
    own = (tolerance, s.control_kind, *(array.tobytes() for array in arrays), *given)
    return own if s.normal is None else (*own, _numbers(s.normal, tolerance))
