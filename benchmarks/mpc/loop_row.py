"""One closed loop as a row, one JSON object a line."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ocp import Rollout

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
        """Write it."""
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(asdict(self), allow_nan=False) + "\n")


def read_loops(file: Path) -> tuple[LoopRow, ...]:
    """Return the rows of a file, the newest of each key."""
    if not file.exists():
        return ()
    rows = map(_row, file.read_text(encoding="utf-8").splitlines())
    return tuple({row.key: row for row in rows}.values())


def _row(line: str) -> LoopRow:
    entry = json.loads(line)
    if "outcomes" in entry:  # as older files have it
        entry["sources"] = entry.pop("outcomes")
    return LoopRow(**{**entry, "times": tuple(entry["times"])})


def found(rows: Sequence[LoopRow], case: str, controller: str, ending: str = "none") -> dict:
    """Return the rows of a case and controller by horizon, shortest first."""
    here = [r for r in rows if (r.case, r.controller, r.ending) == (case, controller, ending)]
    return {row.horizon: row for row in sorted(here, key=lambda row: row.horizon)}
