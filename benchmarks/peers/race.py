"""Everybody solves the same situations in turns, in one run; the referee judges every answer."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.peers.contender import Contender, PeerAnswer, PeerCannotTreat
from benchmarks.peers.conversation import PeerFailed
from benchmarks.peers.entry import Entry
from benchmarks.peers.environment import NotInstalled
from benchmarks.peers.job import Job
from benchmarks.sweep.row import FEASIBLE
from ocp import evaluate

COLD_SOLVES = 5
# Whoever has taken this long for one job [s of processor time] is asked no more: what it has
# answered counts.
PATIENCE = 15.0
_REASONS = {
    PeerCannotTreat: "cannot treat it",
    NotInstalled: "not installed",
    PeerFailed: "failed",
}


@dataclass(eq=False)
class _Runner:
    """A contender on its way through a job."""

    contender: Contender
    build: float = 0.0
    cold: dict[int, PeerAnswer] = field(default_factory=dict)
    warm: dict[int, PeerAnswer] = field(default_factory=dict)
    trouble: Exception | None = None

    @property
    def is_asked(self) -> bool:
        spent = sum(a.seconds for a in (*self.cold.values(), *self.warm.values()))
        return self.trouble is None and spent < PATIENCE

    @property
    def judged(self) -> dict[int, PeerAnswer]:
        """The answers that count: those of the steps, where there are any."""
        return self.warm or self.cold

    def prepare(self, job: Job) -> None:
        try:
            self.build = self.contender.build(job)
        except (PeerCannotTreat, NotInstalled, PeerFailed) as trouble:
            self.trouble = trouble

    def solve(self, job: Job, turn: int, *, cold: bool) -> None:
        """Let it answer, unless it has failed or taken too long."""
        if not self.is_asked:
            return
        try:
            answer = self.contender.solve(job.situations[0 if cold else turn], cold=cold)
        except PeerFailed as trouble:
            self.trouble = trouble
        else:
            (self.cold if cold else self.warm)[turn] = answer


def race(job: Job, contenders: Sequence[Contender], *, cold: int = COLD_SOLVES) -> list[Entry]:
    """Run a job.

    Args:
        job: what everybody is asked.
        contenders: in the order of the table; gaps are taken against the first of ours.
        cold: how often the first situation is solved from the job's guess.

    Returns:
        a row for each contender, also for those that cannot, are not there, or fail.
    """
    runners = [_Runner(contender) for contender in contenders]
    try:
        for runner in runners:
            runner.prepare(job)
        for turn in range(cold):
            for runner in runners:
                runner.solve(job, turn, cold=True)
        for turn in range(1, len(job.situations)):
            for runner in runners:
                runner.solve(job, turn, cold=False)
    finally:
        for runner in runners:
            runner.contender.close()
    return _entries(job, runners)


def _entries(job: Job, runners: list[_Runner]) -> list[Entry]:
    own = [r for r in runners if r.contender.ours and r.trouble is None]
    costs = {id(r): _costs(r) for r in runners if r.trouble is None}
    against = costs[id(own[0])][0] if own else {}
    return [
        _measured(job, r, *costs[id(r)], against, own) if r.trouble is None else _excused(job, r)
        for r in runners
    ]


def _excused(job: Job, runner: _Runner) -> Entry:
    assert runner.trouble is not None
    return Entry(
        job=job.name,
        contender=runner.contender.name,
        ours=runner.contender.ours,
        versions=runner.contender.versions,
        outcome=_REASONS[type(runner.trouble)],
        remark=str(runner.trouble),
    )


def _measured(
    job: Job,
    runner: _Runner,
    costs: dict[int, float],
    violations: list[float],
    against: dict[int, float],
    own: list[_Runner],
) -> Entry:
    asked = len(job.situations) - 1
    remarks = [runner.contender.remark] if runner.contender.remark else []
    if len(runner.warm) < asked:
        remarks.append(f"too slow: stopped after {len(runner.warm)} of {asked} steps")
    common = costs.keys() & against.keys()
    ours, theirs = (sum(c[k] for k in common) for c in (against, costs))
    violation = max(violations)
    return Entry(
        job=job.name,
        contender=runner.contender.name,
        ours=runner.contender.ours,
        versions=runner.contender.versions,
        outcome="measured",
        remark="; ".join(remarks),
        status=list(runner.judged.values())[-1].status,
        solves=len(costs),
        good=sum(v <= FEASIBLE for v in violations),
        cost=_finite(sum(costs.values())) if common else None,
        gap=_finite((theirs - ours) / abs(ours)) if common and ours else None,
        violation=_finite(violation),
        build=runner.build,
        cold=_median(runner.cold),
        warm=_median(runner.warm),
        cold_ratio=_ratio(runner.cold, [r.cold for r in own]),
        warm_ratio=_ratio(runner.warm, [r.warm for r in own]),
    )


def _costs(runner: _Runner) -> tuple[dict[int, float], list[float]]:
    """The referee's costs by turn, and violations; repeated cold solves are the same solve."""
    answers = runner.warm or {0: list(runner.cold.values())[-1]}
    verdicts = {turn: evaluate(answer.plan) for turn, answer in answers.items()}
    costs = {turn: verdict.cost for turn, verdict in verdicts.items()}
    return costs, [verdict.violation for verdict in verdicts.values()]


def _median(answers: dict[int, PeerAnswer]) -> float | None:
    return float(np.median([a.seconds for a in answers.values()])) if answers else None


def _ratio(theirs: dict[int, PeerAnswer], ours: list[dict[int, PeerAnswer]]) -> float | None:
    """Median over the turns of the time over that of the quickest of ours."""
    known = [answers for answers in ours if answers]
    if not theirs or not known:
        return None
    quickest = min(known, key=lambda answers: _median(answers) or np.inf)
    turns = theirs.keys() & quickest.keys()
    if not turns:
        return None
    return float(np.median([theirs[k].seconds / quickest[k].seconds for k in turns]))


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)
