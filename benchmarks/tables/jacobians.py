"""Exact against finite-difference Jacobian: who gets there, in how many steps, how far."""

from collections.abc import Sequence
from statistics import median

from rich.table import Table

from benchmarks.sweep.row import Row

PAIRS = (("shooting", "shooting-fd"), ("indirect-15", "indirect-15-fd"))


def jacobian_table(rows: Sequence[Row]) -> Table | None:
    """Return the pairs side by side, for each group of cases; None without such rows."""
    table = Table(title="exact (left) against finite-difference Jacobian (right)")
    for column in ("cases", "method", "solved", "Newton steps", "time ratio", "smallest residual"):
        table.add_column(column, justify="right" if column != "cases" else "left", no_wrap=True)
    for group in dict.fromkeys(_group(row) for row in rows):
        members = [row for row in rows if _group(row) == group]
        for exact, varied in PAIRS:
            left, right = _named(members, exact), _named(members, varied)
            if left and right:
                table.add_row(group, exact, *_cells(left, right))
    return table if table.row_count else None


def _group(row: Row) -> str:
    return row.case[: len("arm-00-links")] if row.suite == "links" else row.case.split("-")[-1]


def _named(rows: Sequence[Row], solver: str) -> dict[tuple, Row]:
    return {row.setting: row for row in rows if row.solver == solver}


def _cells(exact: dict[tuple, Row], varied: dict[tuple, Row]) -> list[str]:
    both = [(exact[case], varied[case]) for case in exact if case in varied]
    solved = [(a, b) for a, b in both if a.solved and b.solved]
    ratios = [b.solve_time / a.solve_time for a, b in solved]
    return [
        f"{sum(a.solved for a, _ in both)} | {sum(b.solved for _, b in both)} of {len(both)}",
        _two(solved, lambda row: row.iterations, median, "{:.0f}"),
        f"{median(ratios):.2f}" if ratios else "-",
        _two(solved, _residual, min, "{:.0e}"),
    ]


def _residual(row: Row) -> float:
    return row.residual if row.residual is not None else float("inf")


def _two(pairs: list, value, of, form: str) -> str:
    if not pairs:
        return "-"
    return " | ".join(form.format(of([value(pair[side]) for pair in pairs])) for side in (0, 1))
