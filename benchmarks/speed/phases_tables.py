"""What phases cost beside a chain written by hand, as a table."""

from rich.console import Console
from rich.table import Table

from benchmarks.speed.phases import CHAINS, Comparison, compared


def print_phases_speed(console: Console, runs: int = 5) -> list[Comparison]:
    """Measure, print the table, and return the comparisons."""
    found = [compared(chain(), intervals, runs) for chain, intervals in CHAINS]
    table = Table(title="phases beside a chain written by hand in Opti: times in ms, and ratios")
    for column in (
        "chain",
        "cost",
        "apart",
        "build",
        "by hand",
        "ratio",
        "run",
        "by hand",
        "ratio",
    ):
        table.add_column(column, justify="left" if column == "chain" else "right", no_wrap=True)
    for one in found:
        cells = [f"{one.cost:.9g}", f"{abs(one.cost - one.cost_by_hand):.1e}"]
        for here, there in (one.build, one.resolve):
            cells += [f"{1e3 * here:.0f}", f"{1e3 * there:.0f}", f"{here / there:.2f}"]
        table.add_row(one.name, *cells)
    console.print(table)
    return found
