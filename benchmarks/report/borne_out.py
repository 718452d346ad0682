"""The claims, and the references that a row disproves."""

from collections.abc import Sequence

from benchmarks.claims.every import below_reference, claims_of
from benchmarks.report.section import Block, Section, Text, missing
from benchmarks.report.sheet import Sheet
from benchmarks.sweep.row import Row
from benchmarks.tables.comparison import comparison_claims


def borne_out(rows: Sequence[Row]) -> Section:
    """Return the section on the claims."""
    claims = (*claims_of(rows), *comparison_claims(rows))
    lines = [("holds" if c.holds else "FAILS", c.text, c.evidence) for c in claims]
    blocks: list[Block] = [Sheet("claims", ("", "claim", "evidence"), lines)]
    if not claims:
        blocks = [missing("These rows decide none of the claims.")]
    else:
        note = "A claim speaks of a whole suite: on a part of it, it may fail, or hold, by chance."
        blocks.insert(0, Text(note))
    wrong = [(r.case, r.solver, r.cost, r.reference, r.gap) for r in below_reference(rows)]
    if wrong:
        columns = ("case", "method", "cost", "reference", "gap")
        text = "These feasible answers cost less than their references, which are wrong:"
        blocks += [Text(text), Sheet("below", columns, wrong)]
    else:
        blocks.append(Text("No feasible answer costs less than its reference."))
    return Section("claims", "Claims", blocks)
