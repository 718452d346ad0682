"""A seeded mistake: a problem with one thing wrong, and what that is."""

from collections.abc import Callable
from dataclasses import dataclass

from ocp import OCP
from solvers.internal import Cause


@dataclass(frozen=True)
class Mistake:
    """A problem that somebody got wrong.

    Attributes:
        name: unique.
        cause: what is wrong.
        symbol: which constraint, state, control or parameter a diagnosis has to name.
        build: returns the problem.
        held_out: written before the checks and never looked at while they were tuned.
    """

    name: str
    cause: Cause
    symbol: str
    build: Callable[[], OCP]
    held_out: bool = False


@dataclass(frozen=True)
class Sound:
    """A problem in which nothing is wrong: a finding beyond advice is a false alarm.

    Attributes:
        name: unique.
        build: returns the problem.
        held_out: never looked at while the checks were tuned.
    """

    name: str
    build: Callable[[], OCP]
    held_out: bool = False
