"""What did not work, each with its sentence."""

from collections import Counter
from collections.abc import Sequence

from benchmarks.report.level import LOW
from benchmarks.report.section import Block, Section, Text
from benchmarks.report.sheet import Sheet
from benchmarks.report.success import claims
from benchmarks.sweep.row import CRASHED, TIMED_OUT, Row
from ocp import Status

_LOST = {
    TIMED_OUT: "the process was still computing at the time limit",
    CRASHED: "the process that computed it ended before it had an answer",
}


def failures(rows: Sequence[Row]) -> Section:
    """Return the section of everything that is no success."""
    bad = [row for row in rows if not claims(row) or LOW.met_by(row) is False]
    if not bad:
        return Section("failures", "Failures", [Text("There is none.")])
    counts = Counter((row.solver, row.status, _meaning(row)) for row in bad)
    summary = [(*what, number) for what, number in counts.items()]
    lines = [(r.solver, r.case, r.starts, r.seed, r.status, _sentence(r)) for r in bad]
    blocks: list[Block] = [
        Text(
            f"{len(bad)} of {len(rows)} rows: those that their solver does not stand behind, and "
            f"those that it does and the level “{LOW.name}” refuses."
        ),
        Sheet("failure-kinds", ("method", "status", "what that means", "rows"), summary),
        Sheet(
            "failures",
            ("method", "case", "starts", "seed", "status", "what it said"),
            lines,
            folded=len(lines) > 12,
        ),
    ]
    return Section("failures", "Failures", blocks)


def _meaning(row: Row) -> str:
    if row.is_lost:
        return _LOST[row.status]
    if claims(row):
        return "the solver calls it a success, the referee does not"
    return Status[row.status].value if row.status in Status.__members__ else "an unknown status"


def _sentence(row: Row) -> str:
    """Return what a solver said, and what the referee found where that is worse."""
    found = [row.message] if row.message else []
    if row.worst and row.violation is not None and row.violation > LOW.violation:
        found.append(f"violates {row.worst} by {row.violation:.2g}")
    if row.gap is not None and abs(row.gap) > LOW.gap:
        found.append(f"gap {row.gap:.2g}")
    return "; ".join(found) or "–"
