"""Where single shooting ends: at the optimum, at another extremal, or nowhere."""

from collections.abc import Sequence

from rich.table import Table

from benchmarks.sweep.row import Row


def extremes_table(rows: Sequence[Row]) -> Table | None:
    """Return, for each way of shooting, how many zeros of psi(t1) are the optimum.

    None without rows of single shooting with a reference.
    """
    table = Table(title="single shooting: psi(t1) = 0 is necessary, no more")
    for column in ("shooting", "runs", "psi(t1) = 0", "the optimum", "spurious", "no zero"):
        table.add_column(column, justify="left" if column == "shooting" else "right")
    names = [row.solver for row in rows if row.solver.startswith("shooting")]
    for name in dict.fromkeys(names):
        here = [row for row in rows if row.solver == name and row.reference is not None]
        zeros = [row for row in here if row.solved]
        optimal = [row for row in zeros if row.optimum]
        if here:
            counts = (len(here), len(zeros), len(optimal), len(zeros) - len(optimal))
            table.add_row(name, *map(str, (*counts, len(here) - len(zeros))))
    return table if table.row_count else None
