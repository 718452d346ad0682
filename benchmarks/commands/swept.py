"""A sweep on the console: its tables, its claims, its exit code."""

from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.cases import Case
from benchmarks.claims.every import below_reference, claims_of
from benchmarks.methods.method import Method, Settings
from benchmarks.sweep.error import SweepError
from benchmarks.sweep.executors import Execution
from benchmarks.sweep.row import RESULTS, Row
from benchmarks.sweep.sweep import sweep
from benchmarks.sweep.task import tasks_of
from benchmarks.tables.by_method import table_of
from benchmarks.tables.comparison import SUITE as COMPARISON
from benchmarks.tables.comparison import comparison_claims, comparison_table
from benchmarks.tables.extremes import extremes_table
from benchmarks.tables.jacobians import jacobian_table


def print_sweep(
    console: Console,
    cases: Sequence[Case],
    methods: Sequence[Method],
    settings: Sequence[Settings],
    out: Path,
    execution: Execution,
    *,
    resume: bool,
    retry: bool = False,
) -> int:
    """Run the methods on the cases that declare them, print all that the rows say, judge them.

    Returns:
        0 if every claim holds and no reference is disproved, 1 if not, 2 if there was nothing to
        run or nobody to run it, 130 if it was interrupted.
    """
    tasks = tasks_of(cases, methods, *settings)
    if not tasks:
        console.print("no solver declares these cases: nothing to run")
        return 2

    def say(note: str) -> None:
        console.print(note, markup=False, highlight=False, soft_wrap=True)

    try:
        rows = sweep(tasks, out, execution=execution, resume=resume, retry=retry, say=say)
    except SweepError as ended:
        say(f"{ended}; what is in {out / RESULTS} is kept, --resume goes on from there")
        return 2
    except KeyboardInterrupt:
        say(f"interrupted; what is in {out / RESULTS} is kept, --resume goes on from there")
        return 130
    _print_tables(console, rows)
    _print_lost(say, rows)
    console.print(f"rows: {out / RESULTS}")
    return _judge(console, rows)


def _print_lost(say: Callable[[str], None], rows: Sequence[Row]) -> None:
    lost = [row for row in rows if row.is_lost]
    for row in lost:
        say(f"{row.status}: {row.solver} on {row.case}: {row.message}")
    if lost:
        say("--resume --retry computes these again")


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
