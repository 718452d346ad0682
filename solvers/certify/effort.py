"""How much is done for a certificate: the options, and the clock that holds their time limit."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from ocp import Progress
from ocp.internal import check_flag, check_positive, check_whole
from solvers.certify.certificate import Check, Estimate

# What a certificate begins one after the other: a direct answer, methods and groups of checks.
_STAGES = 6


@dataclass(frozen=True)
class CertifyOptions:
    """How much is done for a certificate.

    Attributes:
        intervals: of the coarsest direct grid, and of the conditions checked on a grid.
        starts: random starts in the search for something cheaper.
        seed: of these.
        enumerate: whether extremals are enumerated where that is possible.
        seconds: after so many no further method and no further check is begun; what has begun
            is finished, and methods are tried until one has answered. What was left out counts
            as not checked.
    """

    intervals: int = 40
    starts: int = 5
    seed: int = 0
    enumerate: bool = True
    seconds: float = np.inf

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_whole(self.intervals, "certify: intervals")
        check_whole(self.starts, "certify: starts")
        check_whole(self.seed, "certify: seed", least=0)
        check_flag(self.enumerate, "certify: enumerate")
        check_positive(self.seconds, "certify: seconds", finite=False)


@dataclass(frozen=True)
class Clock:
    """The time limit, and what is told on the way.

    Attributes:
        seconds: the limit.
        begun: when the certificate was begun, of ``perf_counter`` [s].
        report: who is told.
        estimates: what the methods have said so far.
    """

    seconds: float
    begun: float
    report: Progress
    estimates: list[Estimate] = field(default_factory=list)
    _stages: list[str] = field(default_factory=list)

    @classmethod
    def started(cls, seconds: float, report: Progress) -> "Clock":
        """Return the clock of a certificate that begins now."""
        return cls(seconds, perf_counter(), report)

    @property
    def known(self) -> str:
        """The values that are known, in words."""
        return ", ".join(f"{e.cost:.9g} by {e.method.partition(',')[0]}" for e in self.estimates)

    def begin(self, stage: str) -> None:
        """Tell that a stage begins."""
        said = f"{stage}; {self.known}" if self.estimates else stage
        self.report(min(len(self._stages), _STAGES - 1), _STAGES, said)
        self._stages.append(stage)

    def end(self) -> None:
        """Tell that the last stage is over."""
        self.report(_STAGES, _STAGES, self.known)

    @property
    def is_late(self) -> bool:
        """Whether the time limit is reached."""
        return perf_counter() - self.begun > self.seconds

    def checks(self, names: Sequence[str], make: Callable[[], Sequence[Check]]) -> list[Check]:
        """Make some checks, or return that there was no time for them."""
        if self.is_late:
            return [self.left_out(name) for name in names]
        self.begin(", ".join(names))
        return list(make())

    def left_out(self, name: str) -> Check:
        """Return a check that was not made for lack of time."""
        return Check.skipped(name, f"left out: the {self.seconds:g} s it was given were over")
