"""How long it takes to come within a given gap."""

from collections.abc import Sequence

from benchmarks.report.level import LEVELS, ReportLevel
from benchmarks.report.plot import Plot, power_of_ten
from benchmarks.report.rows import Part, parts_of, time_of
from benchmarks.report.section import Block, Section, Text, missing
from benchmarks.report.steps import staircases
from benchmarks.sweep.row import Row

_HOW = (
    "The share of a method's rows that end within a gap of the reference (in the legend: of all "
    "of them), over the time that "
    "their solve took as a whole: to its own tolerance, not to this gap, which it may have passed "
    "long before. Rows keep no times in between, so this is the most that the gap costs, and "
    "says as much about when a method stops. A curve that ends below 100\u00a0% has cases that "
    "the method does not bring that far. A time is that of these machines and of a solve alone: "
    "without building the problem, without the solve of another method that it begins with (see "
    "the methods above), and of the best of several starts only."
)


def reaching(rows: Sequence[Row]) -> Section:
    """Return the section on the time to a gap."""
    blocks: list[Block] = [Text(_HOW)]
    for part in parts_of(rows):
        if any(row.gap is not None for row in part.rows):
            blocks += [_plot(part, level) for level in LEVELS]
        else:
            blocks.append(missing(f"{part.title}: no row has a cost and a reference."))
    return Section("time", "Time to a given gap", blocks)


def _plot(part: Part, level: ReportLevel) -> Plot:
    known = {row.case for row in part.rows if row.reference is not None}
    judged = {m: [row for row in part.of(m) if row.case in known] for m in part.methods}
    reached = {
        m: [time_of(row) for row in rows if row.gap is not None and level.met_by(row)]
        for m, rows in judged.items()
        if rows
    }
    totals = {m: len(rows) for m, rows in judged.items()}
    title = f"{part.title}: within {power_of_ten(level.gap)} of the reference"
    name = f"time-{part.name}-{level.name}"
    return staircases(name, title, reached, totals, part.colours, axis="solve time [s]")
