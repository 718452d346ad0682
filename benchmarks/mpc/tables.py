"""What the closed loops came to, as tables."""

from collections.abc import Callable, Mapping, Sequence

from rich.markup import escape
from rich.table import Table

from benchmarks.mpc.faults import FaultReport
from benchmarks.mpc.faulty import KINDS
from benchmarks.mpc.loop_row import LoopRow
from ocp import InputSource


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)


def _counts(counts: dict[str, int]) -> str:
    return " ".join(f"{name.lower()} {count}" for name, count in counts.items())


# What a column says of a loop.
CELLS: Mapping[str, Callable[[LoopRow], str]] = {
    "case": lambda row: row.case,
    "controller": lambda row: row.controller,
    "horizon": lambda row: f"{row.horizon:g}",
    "ending": lambda row: row.ending,
    "cost 0.8 s": lambda row: _number(row.part, "{:.4f}"),
    "cost": lambda row: _number(row.cost, "{:.4f}"),
    "drift": lambda row: f"{row.drift:.1e}",
    "violation": lambda row: f"{row.violation:.1e}",
    "settled [s]": lambda row: _number(row.settled, "{:.2f}"),
    "residual": lambda row: _number(row.residual, "{:.0e}"),
    "sources": lambda row: _counts(row.sources),
    "solver": lambda row: _counts(row.statuses),
    "median [ms]": lambda row: f"{1e3 * row.times[0]:.1f}",
    "99 %": lambda row: f"{1e3 * row.times[1]:.1f}",
    "worst": lambda row: f"{1e3 * row.times[2]:.1f}",
}
ARM = tuple(name for name in CELLS if name != "settled [s]")
SETTLING = tuple(n for n in CELLS if n not in ("ending", "cost 0.8 s", "drift", "residual"))


def loops_table(rows: Sequence[LoopRow], title: str, columns: Sequence[str] = ARM) -> Table:
    """Return one line for each loop; times of one machine, in ms.

    Args:
        rows: what to show.
        title: above it.
        columns: ``ARM``, ``SETTLING``, or others of ``CELLS``.
    """
    table = Table(title=title)
    for name in columns:
        table.add_column(escape(name), justify="right", no_wrap=name not in ("sources", "solver"))
    for row in rows:
        table.add_row(*(CELLS[name](row) for name in columns))
    return table


def faults_table(report: FaultReport) -> Table:
    """Return how many decisions came from which rung, by kind of fault."""
    verdict = "clean" if report.is_clean else "NOT CLEAN"
    table = Table(title=f"{report.subject}: {report.steps} steps, {verdict}")
    for name in ("fault", "times", *(source.name.lower() for source in InputSource)):
        table.add_column(name, justify="right")
    for kind in ("none", *KINDS):
        counts = [report.sources[kind, source] for source in InputSource]
        table.add_row(kind, str(report.faults[kind] or ""), *(str(n or "") for n in counts))
    return table


def said(report: FaultReport) -> str:
    """Return what was found, in a line."""
    return (
        f"{report.subject}: {report.bad_inputs} inputs not finite or out of bounds, "
        f"{report.unnamed} steps unnamed, {report.lies} wrongly called optimal, "
        f"{report.slow} faults without recovery, {report.refused} refusals, "
        f"{report.differing} of {report.replayed} failures replay differently"
    )
