"""The fault campaign: whatever fails, every input is one that may be sent to a robot."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.mpc.fault_problems import FaultProblem, arm, cart, heating
from benchmarks.mpc.faulty import NEVER_OPTIMAL, Hindered, Schedule, active, schedule
from benchmarks.mpc.followed import before, outside_limits
from ocp import MPC, Decision, FlightRecorder, InputSource, Rollout, closed_loop, replay_all

SUBJECTS: Mapping[str, Callable[[Schedule], FaultProblem]] = {
    "cart": cart,
    "arm": arm,
    "heating": heating,
}
# Steps in one loop and one flight record.
PIECE = 500
# What a row that limits an input may be left by.
_ROUNDING = 1e-9
# Steps after a fault within which a decision is optimal again.
RECOVERY = 10


@dataclass(frozen=True, kw_only=True)
class FaultReport:
    """What a campaign on one subject found; all but the counts should be zero.

    Attributes:
        subject: of ``SUBJECTS``.
        steps: in all.
        faults: faults by kind.
        sources: decisions by kind of fault ("none" between them) and rung.
        bad_inputs: that are not finite or leave a row that limits them.
        unnamed: steps that are not optimal and do not say why.
        lies: steps called optimal although they cannot be.
        slow: faults after which no decision was optimal within ``RECOVERY`` calm steps.
        refused: loops that ended early.
        replayed: failures that were decided again from the flight record.
        differing: those that came out otherwise, in any bit.
    """

    subject: str
    steps: int
    faults: Counter[str]
    sources: Counter[tuple[str, InputSource]]
    bad_inputs: int
    unnamed: int
    lies: int
    slow: int
    refused: int
    replayed: int
    differing: int

    @property
    def is_clean(self) -> bool:
        """Whether nothing was found."""
        found = (self.bad_inputs, self.unnamed, self.lies, self.slow, self.refused, self.differing)
        return not any(found)

    def __add__(self, other: "FaultReport") -> "FaultReport":
        """Return both as one."""
        mine, yours = vars(self), vars(other)
        return FaultReport(
            subject=self.subject,
            **{name: mine[name] + yours[name] for name in mine if name != "subject"},
        )


def campaign(
    subject: str, steps: int, *, seed: int = 0, executor: Executor | None = None
) -> Iterator[FaultReport]:
    """Run the loop for a number of steps, in pieces with their own random numbers.

    Args:
        subject: of ``SUBJECTS``.
        steps: in all.
        seed: of the first piece; the others have the next ones.
        executor: where pieces run, several at once; None: here, one after the other.

    Yields:
        The report of each piece when it is ready; their sum is that of the campaign.
    """
    counts = [min(PIECE, steps - first) for first in range(0, steps, PIECE)]
    run = executor.map if executor else map
    yield from run(partial(_piece, subject), counts, count(seed))


def _piece(name: str, steps: int, seed: int) -> FaultReport:
    faults = schedule(steps, seed)
    subject = SUBJECTS[name](faults)
    mpc, hindered = subject.mpc, Hindered(subject.mpc, faults)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "flight"
        with FlightRecorder(mpc, file) as recorder:
            rollout = closed_loop(
                hindered, subject.plant, subject.x0, steps * mpc.dt,
                dt=mpc.dt, seed=seed, sensors=hindered.sensors, watch=recorder.watch,
            )  # fmt: skip
        failed = [k for k, o in enumerate(rollout.sources) if o is not InputSource.OPTIMAL]
        again = [replayed.is_exact for replayed in replay_all(mpc, file, failed)]
    return _judged(name, subject, faults, rollout, again)


def _judged(
    name: str, subject: FaultProblem, faults: Schedule, rollout: Rollout, again: list[bool]
) -> FaultReport:
    dt, decisions = subject.mpc.dt, rollout.decisions
    at = [active(faults, d.t, dt) for d in decisions]
    kinds = [fault.kind if fault else "none" for fault in at]
    return FaultReport(
        subject=name,
        steps=len(decisions),
        faults=Counter(fault.kind for fault in faults),
        sources=Counter((kind, d.source) for kind, d in zip(kinds, decisions, strict=True)),
        bad_inputs=sum(
            _leaves_limits(subject.mpc, x, d, last)
            for x, d, last in zip(rollout.x, decisions, before(rollout), strict=False)
        ),
        unnamed=sum(d.source is not InputSource.OPTIMAL and not d.message for d in decisions),
        lies=sum(
            kind in NEVER_OPTIMAL and d.source is InputSource.OPTIMAL
            for kind, d in zip(kinds, decisions, strict=True)
        ),
        slow=sum(_is_slow(rollout, fault.last + 1) for fault in faults),
        refused=int(bool(rollout.ended)),
        replayed=len(again),
        differing=again.count(False),
    )


def _leaves_limits(mpc: MPC, x: np.ndarray, decision: Decision, last: np.ndarray | None) -> bool:
    """Whether an input leaves its bounds, or a row that limits it in the true state."""
    if not np.isfinite(decision.input).all():
        return True
    if mpc.applied.box(mpc.ocp).excess(decision.input).any():
        return True
    if mpc.applied.what == "rate":
        return False
    return outside_limits(mpc.ocp, x, decision, last) > _ROUNDING


def _is_slow(rollout: Rollout, first: int) -> bool:
    """Whether none of the calm steps after a fault is optimal."""
    after = rollout.sources[first : first + RECOVERY]
    return len(after) == RECOVERY and InputSource.OPTIMAL not in after
