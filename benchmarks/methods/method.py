"""What a method is, and what it returns."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from benchmarks.cases import Case, Family
from ocp import OCP, Evaluation, Solution, evaluate


@dataclass(frozen=True)
class Settings:
    """What a sweep sets for all methods.

    Attributes:
        starts: of the multi-start.
        seed: of everything random.
    """

    starts: int = 10
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a method returned.

    Attributes:
        solution: its answer.
        verdict: the referee's, where it is not the usual one.
        local_gap: how far the referee's cost lies above the local optimum that direct multiple
            shooting reaches from this answer, relative; None where that is not asked.
    """

    solution: Solution
    verdict: Evaluation
    local_gap: float | None = None


@dataclass(frozen=True)
class Method:
    """A row of the comparison.

    Attributes:
        name: what the tables call it.
        family: which cases it runs on: those that declare the family.
        suites: the suites it belongs to.
        run: (case, settings) -> outcome.
        settings: its options, as text, for the record.
        about: one line for ``list``.
    """

    name: str
    family: Family
    suites: frozenset[str]
    run: Callable[[Case, Settings], Outcome]
    settings: str
    about: str


@lru_cache(maxsize=4)
def problem(case: Case) -> OCP:
    """Return the problem of a case, the same object for methods that follow each other."""
    return case.build()


def judged(solution: Solution) -> Outcome:
    """Return a solution with the referee's verdict."""
    return Outcome(solution, evaluate(solution))
