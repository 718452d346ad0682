"""How far from the optimum, and how far outside of the constraints."""

from collections.abc import Sequence

from benchmarks.report.level import LEVELS
from benchmarks.report.plot import Plot
from benchmarks.report.rows import Part, parts_of
from benchmarks.report.section import Block, Section, Text, missing
from benchmarks.report.sheet import Sheet
from benchmarks.report.strips import strips
from benchmarks.sweep.row import Row

_GAPS = (1e-10, 1e4)
_VIOLATIONS = (1e-16, 1e4)
_HOW = (
    "A dot is a row, a bar the median of a method, dotted lines the levels of the table above. The "
    "gap is the referee's cost above the reference, relative; of a cost below it, which the "
    "accuracy of the reference or a violation allows, the size. The violation is the largest "
    "of all constraints, between the nodes too, each in its own unit."
)


def gaps(rows: Sequence[Row]) -> Section:
    """Return the section on distributions."""
    blocks: list[Block] = [Text(_HOW)]
    parts = parts_of(rows)
    blocks += sorted(
        [*map(_gap, parts), *map(_violation, parts)], key=lambda block: block.kind != "plot"
    )
    return Section("gaps", "Gap and violation", blocks)


def _gap(part: Part) -> Block:
    lines = [(r.solver, r.case, r.starts, r.seed, r.gap) for r in part.rows if r.gap is not None]
    if not lines:
        return missing(f"{part.title}: no row has a cost and a reference, so there is no gap.")
    values = {m: [abs(r.gap) for r in part.of(m) if r.gap is not None] for m in part.methods}
    name = f"gap-{part.name}"
    limits = sorted({level.gap for level in LEVELS})
    svg = strips(name, values, part.colours, "|gap|, relative", *_GAPS, limits)
    data = Sheet(name, ("method", "case", "starts", "seed", "gap, relative"), lines, folded=True)
    return Plot(name, f"{part.title}: distance from the reference", svg, data)


def _violation(part: Part) -> Block:
    lines = [
        (r.solver, r.case, r.starts, r.seed, r.violation, r.worst)
        for r in part.rows
        if r.violation is not None
    ]
    if not lines:
        return missing(f"{part.title}: the referee could judge no row.")
    if not any(row.violation for row in part.rows):
        return Text(f"{part.title}: of {len(lines)} judged rows none violates anything.")
    values = {m: [r.violation for r in part.of(m) if r.violation is not None] for m in part.methods}
    name = f"violation-{part.name}"
    limits = sorted({level.violation for level in LEVELS})
    svg = strips(name, values, part.colours, "violation [its own unit]", *_VIOLATIONS, limits)
    columns = ("method", "case", "starts", "seed", "violation, in its unit", "of what")
    return Plot(
        name,
        f"{part.title}: largest violation of a constraint",
        svg,
        Sheet(name, columns, lines, folded=True),
    )
