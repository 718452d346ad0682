"""The measured speed of MPC on the arm as tables."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from benchmarks.speed.arm import (
    INTERVALS,
    LINKS,
    Field,
    N,
    Steps,
    arm,
    contenders,
    exponent,
    race,
    stagewise,
)
from benchmarks.speed.driver_overhead import driver_overhead, overhead_table
from benchmarks.speed.stage_code import StageCode, code_table


def print_arm_speed(
    console: Console,
    intervals: Sequence[int] = INTERVALS,
    links: Sequence[int] = LINKS,
    count: int = 40,
    *,
    only_driver: bool = False,
) -> None:
    """Measure and print everything, or only what the driver costs around a solver."""
    if not only_driver:
        _print_steps(console, intervals, links, count)
    console.print(overhead_table(driver_overhead()))


def _print_steps(
    console: Console, intervals: Sequence[int], links: Sequence[int], count: int
) -> None:
    console.print(ratio_table(race({N: Field(arm(), contenders())}, count)[N]))
    if intervals:
        grown = race({n: Field(arm(), contenders(n)) for n in intervals}, count)
        console.print(growth_table(grown, "3 links: one step in ms over the intervals N"))
    if links:
        # Interpreted, and for the other solvers, ten links take minutes.
        grown = race({n: Field(arm(n), stagewise(), (True,)) for n in links}, count)
        console.print(growth_table(grown, f"N = {N}: one step in ms over the links"))
        console.print(code_table([StageCode.of(n) for n in links]))


def ratio_table(steps: Sequence[Steps]) -> Table:
    """Return one line a contender: medians, and the median ratios of the pairs."""
    table = Table(title=f"arm, 3 links, N = {N}: one warm-started step of MPC, in turns")
    columns = ("solver", "stages", "ms", "of interpreted", "of interpreted ipopt", "new plans")
    for column in columns:
        justify = "left" if column in columns[:2] else "right"
        table.add_column(column, justify=justify, no_wrap=True)
    slow = {s.name: s for s in steps if not s.compiled}
    first = next(iter(slow.values()))
    for s in steps:
        ratios = f"{s.over(slow[s.name]):.2f}", f"{s.over(first):.2f}"
        stages = "compiled" if s.compiled else "interpreted"
        table.add_row(s.name, stages, f"{1e3 * s.median:.2f}", *ratios, f"{s.planned:.0%}")
    return table


def growth_table(grown: dict[int, list[Steps]], title: str) -> Table:
    """Return one line a contender: median milliseconds over a size, and the exponent."""
    table = Table(title=title)
    for column in ("solver", "stages", *map(str, grown), "exponent"):
        justify = "left" if column in ("solver", "stages") else "right"
        table.add_column(column, justify=justify, no_wrap=True)
    for line in zip(*grown.values(), strict=True):
        medians = tuple(s.median for s in line)
        slope = f"{exponent(tuple(grown), medians):.2f}" if len(grown) > 1 else "-"
        stages = "compiled" if line[0].compiled else "interpreted"
        table.add_row(line[0].name, stages, *(f"{1e3 * m:.2f}" for m in medians), slope)
    return table
