"""A sweep on the console: its tables, its claims, its exit code."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.cases import Case
from benchmarks.claims import below_reference, claims_of
from benchmarks.comparison import SUITE as COMPARISON
from benchmarks.comparison import comparison_claims, comparison_table
from benchmarks.extremes import extremes_table
from benchmarks.jacobians import jacobian_table
from benchmarks.method import Method, Settings
from benchmarks.row import RESULTS, Row
from benchmarks.sweep import sweep, tasks_of
from benchmarks.table import table_of


def print_sweep(
    console: Console,
    cases: Sequence[Case],
    methods: Sequence[Method],
    settings: Settings,
    out: Path,
    workers: int,
    resume: bool,
) -> int:
    """Run the methods on the cases that declare them, print all that the rows say, judge them.

    Returns:
        0 if every claim holds and no reference is disproved, 1 if not, 2 if there was nothing to
        run.
    """
    tasks = tasks_of(cases, methods, settings)
    if not tasks:
        console.print("no solver declares these cases: nothing to run")
        return 2
    rows = sweep(tasks, out, workers=workers, resume=resume)
    _print_tables(console, rows)
    console.print(f"rows: {out / RESULTS}")
    return _judge(console, rows)


def _print_tables(console: Console, rows: Sequence[Row]) -> None:
    for suite in dict.fromkeys(row.suite for row in rows if row.suite != COMPARISON):
        for kind in ("sum", "closest") if suite == "arm" else ("",):
            here = [row for row in rows if row.suite == suite and row.case.endswith(kind)]
            if here:
                console.print(table_of(here, f"{suite} {kind}".strip()))
    compared = [comparison_table(rows, kind) for kind in ("closest", "sum")]
    for table in (*compared, extremes_table(rows), jacobian_table(rows)):
        if table is not None:
            console.print(table)


def _judge(console: Console, rows: Sequence[Row]) -> int:
    """Print the claims; return 1 if one fails or a reference is disproved."""
    claims = (*claims_of(rows), *comparison_claims(rows))
    for claim in claims:
        console.print(f"{'holds' if claim.holds else 'FAILS'}: {claim.text} ({claim.evidence})")
    wrong = below_reference(rows)
    for row in wrong:
        console.print(
            f"FAILS: {row.solver} costs {row.gap:.1e} relative less than the reference of "
            f"{row.case}: the reference is wrong ({row.cost} < {row.reference})"
        )
    return int(bool(wrong) or not all(claim.holds for claim in claims))
