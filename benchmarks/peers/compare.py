"""A run of the comparison: jobs by contenders, with what is needed to repeat it."""

import os
import platform
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.peers.contender import Contender, PeerContender
from benchmarks.peers.entry import Entry, PeerReport
from benchmarks.peers.environment import Environment
from benchmarks.peers.jobs import NamedJob
from benchmarks.peers.ours import own_contenders
from benchmarks.peers.peer import PeerPackage
from benchmarks.peers.race import COLD_SOLVES, race
from benchmarks.sweep.row import machine


def compare(
    peers: Sequence[PeerPackage],
    jobs: Sequence[NamedJob],
    *,
    cold: int = COLD_SOLVES,
    cache: Path | None = None,
    said: Callable[[str], None] = lambda line: None,
) -> PeerReport:
    """Run jobs by our solvers and by peers, job by job.

    Args:
        peers: who takes part beside ours.
        jobs: what is solved.
        cold: how often the cold solve is repeated.
        cache: of the environments.
        said: is told which job comes next.
    """
    titles: dict[str, str] = {}
    entries: list[Entry] = []
    load = [_load()]
    for named in jobs:
        job = named.make()
        titles[job.name] = job.title
        said(job.title)
        others: list[Contender] = [
            PeerContender(peer, setting, Environment(peer, cache))
            for peer in peers
            for setting in peer.settings
        ]
        found = race(job, [*own_contenders(job), *others], cold=cold)
        entries += _merged(found)
    load.append(_load())
    return PeerReport(machine=_machine(), load=load, titles=titles, entries=tuple(entries))


def _merged(entries: Sequence[Entry]) -> list[Entry]:
    """Say once what no setting of a peer can do."""
    kept: list[Entry] = []
    for entry in entries:
        name = entry.contender.split(",")[0]
        settings = [other for other in entries if other.contender.split(",")[0] == name]
        common = {(other.outcome, other.remark) for other in settings}
        if len(common) > 1 or entry.outcome != "cannot treat it":
            kept.append(entry)
        elif entry is settings[0]:
            kept.append(replace(entry, contender=name))
    return kept


def _load() -> float:
    """Waiting processes, averaged over a minute; -1 where the system does not say."""
    return round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else -1.0


def _machine() -> dict[str, str]:
    return {**machine(), "cpu": _processor(), "release": platform.release().split("-")[0]}


def _processor() -> str:
    """What the processor calls itself, where the system says it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
