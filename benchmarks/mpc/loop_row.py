"""One closed loop as a row, one JSON object a line."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_type_hints

import numpy as np

from benchmarks.sweep.json_line import check_types, entry_of, line_of
from ocp import Rollout
from ocp.internal import append_line

PART = 0.8  # [s], the simulation of the thesis


@dataclass(frozen=True, kw_only=True)
class LoopRow:
    """What the plant saw of one closed loop; None where it ended early.

    Attributes:
        case: the scenario or problem.
        controller: what decided.
        horizon: [s]; 0 where there is none.
        ending: the terminal cost, in a word.
        part: the plant's cost of the first 0.8 s.
        cost: the plant's cost of all of it.
        drift: largest task error [m].
        violation: the plant's largest violation.
        residual: the largest of all steps.
        sources: decisions by rung.
        statuses: decisions by how the solver ended.
        times: median, 99 % and worst time of a step [s].
        ended: why the loop ended early.
        settled: from when on the plant is where it shall be [s]; None where it is not at the
            end, or where that is not asked.
    """

    case: str
    controller: str
    horizon: float
    ending: str = "none"
    part: float | None
    cost: float | None
    drift: float
    violation: float
    residual: float | None
    sources: dict[str, int]
    statuses: dict[str, int]
    times: tuple[float, float, float]
    ended: str
    settled: float | None = None

    @classmethod
    def of(
        cls,
        case: str,
        controller: str,
        horizon: float,
        rollout: Rollout,
        *,
        ending: str = "none",
        settled: float | None = None,
    ) -> "LoopRow":
        """Read it off a rollout."""
        residual = max((d.residual for d in rollout.decisions if d.status), default=np.inf)
        statuses = [d.status.name for d in rollout.decisions if d.status]
        whole = not rollout.ended
        first = rollout.t[1:] <= PART + 1e-9
        times = rollout.step_times
        return cls(
            case=case,
            controller=controller,
            horizon=horizon,
            ending=ending,
            part=float(rollout.costs[first].sum()) if whole else None,
            cost=rollout.cost if whole else None,
            drift=rollout.drift,
            violation=rollout.violation,
            residual=residual if np.isfinite(residual) else None,
            sources={o.name: count for o, count in rollout.counts.items() if count},
            statuses={name: statuses.count(name) for name in sorted(set(statuses))},
            times=(float(np.median(times)), float(np.quantile(times, 0.99)), float(times.max()))
            if len(times)
            else (0.0, 0.0, 0.0),
            ended=rollout.ended,
            settled=settled,
        )

    @property
    def key(self) -> tuple[str, str, float, str]:
        """What makes a row the same row in another run."""
        return self.case, self.controller, self.horizon, self.ending

    def append_to(self, file: Path) -> None:
        """Write it as a whole and bring it to the disk.

        Raises:
            OSError: if it cannot be written; the file is as it was.
        """
        file.parent.mkdir(parents=True, exist_ok=True)
        append_line(file, line_of(self).encode())


def read_loops(file: Path, say: Callable[[str], object] = lambda note: None) -> tuple[LoopRow, ...]:
    """Return the rows of a file, the newest of each key.

    Args:
        file: of rows; none: there are none.
        say: is called with a sentence for every line that is no row.
    """
    if not file.exists():
        return ()
    rows = {}
    for number, line in enumerate(file.read_bytes().split(b"\n"), start=1):
        if not line.strip():
            continue
        try:
            row = _row(line.decode())
        except ValueError as wrong:
            say(f"line {number} of {file.name} is no row: {wrong}")
        else:
            rows[row.key] = row
    return tuple(rows.values())


def _row(line: str) -> LoopRow:
    entry = entry_of(line)
    if "outcomes" in entry:  # as older files have it
        entry["sources"] = entry.pop("outcomes")
    hints = get_type_hints(LoopRow)
    entry = {"ending": "none", "settled": None, **entry}
    if entry.keys() != hints.keys():
        raise ValueError(f"its fields are {', '.join(sorted(entry))}")
    check_types(entry, hints)
    return LoopRow(**{**entry, "times": tuple(entry["times"])})


def found(rows: Sequence[LoopRow], case: str, controller: str, ending: str = "none") -> dict:
    """Return the rows of a case and controller by horizon, shortest first."""
    here = [r for r in rows if (r.case, r.controller, r.ending) == (case, controller, ending)]
    return {row.horizon: row for row in sorted(here, key=lambda row: row.horizon)}
