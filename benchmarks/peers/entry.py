"""One row of the comparison, and the file that keeps them all."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from ocp.internal import with_checksum, without_checksum, write_file

VERSION = 1


class BadResults(Exception):
    """A file of results that cannot be read; the text says why."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """What came out for one contender on one job; None where a thing does not exist.

    Attributes:
        job: name of the job.
        contender: who, with its setting.
        ours: whether it is one of our solvers.
        versions: of what computed.
        outcome: "measured", "cannot treat it", "not installed", "failed".
        remark: reason or reservation, in words.
        status: of the last solve, in the contender's own words.
        solves: how many solves count: those of a job with steps without the cold one.
        good: how many of them the referee found feasible.
        cost: sum of the referee's costs of these solves; None if a state blows up, or where ours
            has no such solves.
        gap: relative to the sum of the first of our solvers over the same solves.
        violation: largest one the referee found, in the problem's units.
        build: time to build it [s].
        cold: median of a cold solve, processor time [s].
        warm: median of a warm step, processor time [s].
        cold_ratio: median ratio to the quickest of ours, run by run.
        warm_ratio: the same of the warm steps.
    """

    job: str
    contender: str
    ours: bool = False
    versions: dict[str, str]
    outcome: str
    remark: str = ""
    status: str = ""
    solves: int = 0
    good: int = 0
    cost: float | None = None
    gap: float | None = None
    violation: float | None = None
    build: float | None = None
    cold: float | None = None
    warm: float | None = None
    cold_ratio: float | None = None
    warm_ratio: float | None = None


@dataclass(frozen=True, kw_only=True)
class PeerReport:
    """A run of the comparison: where it ran, what it was asked, what came out.

    Attributes:
        machine: what the machine says of itself.
        load: waiting processes when it began and when it ended.
        titles: of the jobs, by name.
        entries: the rows.
    """

    machine: dict[str, str]
    load: list[float]
    titles: dict[str, str]
    entries: tuple[Entry, ...]

    def write(self, file: Path) -> None:
        """Write it as JSON, in one piece."""
        file.parent.mkdir(parents=True, exist_ok=True)
        content = with_checksum({"version": VERSION, **asdict(self)})
        write_file(file, (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())

    @classmethod
    def read(cls, file: Path) -> "PeerReport":
        """Read it; a file of an earlier version has no checksum.

        Raises:
            BadResults: if it is not there, torn, damaged, or of another version.
        """
        try:
            data = without_checksum(json.loads(file.read_text(encoding="utf-8")))
            if data.pop("version") != VERSION:
                raise BadResults(f"{file.name} is of another version of this program")
            data["entries"] = tuple(Entry(**entry) for entry in data["entries"])
            return cls(**data)
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as no:
            raise BadResults(f"{file.name} cannot be read: {no}") from no
