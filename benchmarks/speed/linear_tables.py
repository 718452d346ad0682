"""The measured speed of linear control as tables."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from benchmarks.speed.linear import (
    FITTED_FROM,
    HORIZONS,
    PEER_HORIZON,
    Growth,
    feedback_law_time,
    growth,
)


def print_speed(
    console: Console, horizons: Sequence[int] = HORIZONS, count: int = 20
) -> list[Growth]:
    """Measure, print the tables, and return the growth over the horizon."""
    grown = growth(horizons, count)
    console.print(growth_table(grown, horizons))
    law = feedback_law_time(PEER_HORIZON)
    console.print(f"applying a gain that is known, u = -K x: {1e3 * law:.4f} ms at any N")
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
