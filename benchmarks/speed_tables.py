"""The measured speed of linear control as tables."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from benchmarks.linear_speed import (
    FITTED_FROM,
    HORIZONS,
    PEER_HORIZON,
    Growth,
    Pair,
    feedback_law_time,
    growth,
    peer_pairs,
)

BACKENDS = ("osqp", "piqp", "clarabel", "daqp", "proxqp", "quadprog")


def print_speed(
    console: Console, horizons: Sequence[int] = HORIZONS, count: int = 20
) -> list[Growth]:
    """Measure, print the tables, and return the growth over the horizon."""
    grown = growth(horizons, count)
    console.print(growth_table(grown, horizons))
    law = feedback_law_time(PEER_HORIZON)
    console.print(f"applying a gain that is known, u = -K x: {1e3 * law:.4f} ms at any N")
    pairs = peer_pairs(BACKENDS, 4 * count)
    if pairs is None:
        console.print("qpmpc is not installed, the comparison is left out: pip install qpmpc")
    else:
        console.print(peer_table(pairs))
    return grown


def growth_table(grown: Sequence[Growth], horizons: Sequence[int]) -> Table:
    """Return one line a method: median milliseconds over N, and the fitted exponent."""
    table = Table(title=f"one step in ms over N; exponent fitted from N = {FITTED_FROM} on")
    for column in ("method", *map(str, horizons), "exponent"):
        table.add_column(column, justify="left" if column == "method" else "right", no_wrap=True)
    for line in grown:
        times = dict(zip(line.steps, line.times, strict=True))
        cells = [f"{1e3 * times[n]:.2f}" if n in times else "-" for n in horizons]
        exponent = "-" if line.exponent is None else f"{line.exponent:.2f}"
        table.add_row(line.method, *cells, exponent)
    return table


def peer_table(pairs: Sequence[Pair]) -> Table:
    """Return one line a backend and form: medians, and the median ratio of the pairs."""
    title = f"LinearMPC against qpmpc, N = {PEER_HORIZON}, constraints active, times in ms"
    table = Table(title=title)
    for column in ("backend", "form", "ours", "qpmpc", "ratio", "inputs apart in N"):
        table.add_column(column, justify="left" if column in ("backend", "form") else "right")
    for p in pairs:
        times = f"{1e3 * p.ours:.3f}", f"{1e3 * p.theirs:.3f}", f"{p.ratio:.2f}"
        table.add_row(p.backend, p.form, *times, f"{p.apart:.0e}")
    return table
