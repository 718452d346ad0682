"""What the closed loops came to, as tables."""

from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from benchmarks.mpc.faults import Report
from benchmarks.mpc.faulty import KINDS
from benchmarks.mpc.loop_row import LoopRow
from ocp import Outcome


def loops_table(rows: Sequence[LoopRow], title: str) -> Table:
    """Return one line for each loop; times of one machine, in ms."""
    table = Table(title=title)
    names = ("case", "controller", "horizon", "ending", "cost 0.8 s", "cost", "drift", "violation")
    for name in (*names, "residual", "outcomes", "solver", "median [ms]", "99 %", "worst"):
        table.add_column(escape(name), justify="right", no_wrap=True)
    for row in rows:
        table.add_row(
            row.case,
            row.controller,
            f"{row.horizon:g}",
            row.ending,
            _number(row.part, "{:.4f}"),
            _number(row.cost, "{:.4f}"),
            f"{row.drift:.1e}",
            f"{row.violation:.1e}",
            _number(row.residual, "{:.0e}"),
            _counts(row.outcomes),
            _counts(row.statuses),
            *(f"{1e3 * time:.1f}" for time in row.times),
        )
    return table


def faults_table(report: Report) -> Table:
    """Return how many decisions came from which rung, by kind of fault."""
    verdict = "clean" if report.is_clean else "NOT CLEAN"
    table = Table(title=f"{report.subject}: {report.steps} steps, {verdict}")
    for name in ("fault", "times", *(outcome.name.lower() for outcome in Outcome)):
        table.add_column(name, justify="right")
    for kind in ("none", *KINDS):
        counts = [report.outcomes[kind, outcome] for outcome in Outcome]
        table.add_row(kind, str(report.faults[kind] or ""), *(str(n or "") for n in counts))
    return table


def said(report: Report) -> str:
    """Return what was found, in a line."""
    return (
        f"{report.subject}: {report.bad_inputs} inputs not finite or out of bounds, "
        f"{report.unnamed} steps unnamed, {report.lies} wrongly called optimal, "
        f"{report.slow} faults without recovery, {report.refused} refusals, "
        f"{report.differing} of {report.replayed} failures replay differently"
    )


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)


def _counts(counts: dict[str, int]) -> str:
    return " ".join(f"{name.lower()} {count}" for name, count in counts.items())
