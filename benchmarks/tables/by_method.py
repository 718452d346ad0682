"""Rows condensed to a table: one line a method."""

from collections.abc import Callable, Sequence
from statistics import median

from rich.markup import escape
from rich.table import Table

from benchmarks.sweep.row import Row

_COLUMNS = (
    "solver",
    "runs",
    "solved",
    "optimum",
    "median gap",
    "worst gap",
    "own basin",
    "violation",
    "iterations",
    "build [s]",
    "solve [s]",
    "time ratio",
)


def table_of(rows: Sequence[Row], title: str) -> Table:
    """Return the table of one suite, methods in the order of their first row.

    "solved" counts what the method stands behind and the referee finds feasible; "optimum"
    those of them within the gap of the reference. Gaps are those of the solved rows; "own
    basin" is the median distance, of all rows, from the local optimum below them. Times
    of one machine say little; "time ratio" is the median, case by case, of the solve time over
    that of the first method in the same run.
    """
    table = Table(title=title)
    for column in _COLUMNS:
        justify = "left" if column == "solver" else "right"
        table.add_column(escape(column), justify=justify, no_wrap=True)
    yardstick = {row.setting: row.solve_time for row in rows if row.solver == rows[0].solver}
    for name in dict.fromkeys(row.solver for row in rows):
        here = [row for row in rows if row.solver == name]
        table.add_row(name, *_cells(here, yardstick))
    return table


def _cells(rows: Sequence[Row], yardstick: dict[tuple, float]) -> list[str]:
    solved = [row for row in rows if row.solved]
    gaps = [row.gap for row in solved if row.gap is not None]
    known = [row for row in rows if row.optimum is not None]
    violations = [row.violation for row in solved if row.violation is not None]
    ratios = [row.solve_time / yardstick[row.setting] for row in rows if row.setting in yardstick]
    return [
        str(len(rows)),
        str(len(solved)),
        f"{sum(bool(row.optimum) for row in known)}/{len(known)}" if known else "-",
        _number(median, gaps, "{:.1e}"),
        _number(max, gaps, "{:.1e}"),
        _number(median, [row.local_gap for row in rows if row.local_gap is not None], "{:.1e}"),
        _number(max, violations, "{:.0e}"),
        _number(median, [row.iterations for row in rows], "{:.0f}"),
        _number(median, [row.build_time for row in rows], "{:.3f}"),
        _number(median, [row.solve_time for row in rows], "{:.3f}"),
        _number(median, ratios, "{:.2f}"),
    ]


def _number(of: Callable, values: Sequence[float], form: str) -> str:
    return form.format(of(values)) if values else "-"
