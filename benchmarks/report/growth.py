"""What an iteration costs when the problem grows."""

import re
from collections.abc import Callable, Mapping, Sequence
from statistics import median

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, NullLocator

from benchmarks.report.plot import Legend, Plot, as_series, colour, dashes, drawn, powers_of_ten
from benchmarks.report.section import Block, Section, Text, missing
from benchmarks.report.sheet import Sheet
from benchmarks.sweep.row import Row

# (size, time of an iteration [s]), sorted by size.
Curve = list[tuple[int, float]]

_HOW = (
    "The median time of an iteration over the number of states n and over the intervals N of the "
    "grid, for methods whose rows in a suite have at least two different ones. The time of a "
    "whole solve would mix in how many iterations a start needs. The exponent p is that of time ∝ "
    "sizeᵖ, by least squares of the logarithms; of two points it is no more than their slope. "
    "Only the suite “links” has problems that differ in nothing but their size."
)


def growth(rows: Sequence[Row]) -> Section:
    """Return the section on growth."""
    over_n = _curves(rows, lambda row: f"{row.suite}: {row.solver}", lambda row: row.states)
    over_grid = _curves(rows, _family, lambda row: row.intervals)
    blocks = [
        _block("growth-n", "states n", over_n, "two sizes of problem"),
        _block("growth-grid", "intervals N", over_grid, "two grids with otherwise equal options"),
    ]
    return Section("growth", "Growth over n and N", [Text(_HOW), *blocks])


def _family(row: Row) -> str:
    """The suite, and the options of a method without the size of its grid."""
    options = re.sub(r"\b(intervals|steps)=\d+", r"\1=…", row.settings)
    return f"{row.suite}: {options}"


def _curves(
    rows: Sequence[Row], group: Callable[[Row], str], size: Callable[[Row], int | None]
) -> dict[str, Curve]:
    """Return the median times of the groups that come in at least two sizes."""
    times: dict[str, dict[int, list[float]]] = {}
    for row in rows:
        length = size(row)
        if length and row.iterations and row.solve_time > 0.0:
            own = times.setdefault(group(row), {})
            own.setdefault(length, []).append(row.solve_time / row.iterations)
    return {
        name: [(length, median(own[length])) for length in sorted(own)]
        for name, own in times.items()
        if len(own) > 1
    }


def _block(name: str, axis: str, curves: Mapping[str, Curve], needed: str) -> Block:
    if not curves:
        return missing(f"Over {axis}: no method has rows of {needed}.")
    titles = {group: _short(group) for group in curves}
    lines = [(group, x, y, exponent(curve)) for group, curve in curves.items() for x, y in curve]

    def draw(axes: Axes) -> None:
        for number, curve in enumerate(curves.values()):
            style = {"ls": dashes(number), "color": colour(number), "lw": 1.8, "marker": "o"}
            x, y = zip(*curve, strict=True)
            as_series(axes.plot(x, y, ms=4.5, **style), number)
        axes.set_xscale("log")
        axes.set_yscale("log")
        sizes = sorted({x for curve in curves.values() for x, _ in curve})
        axes.set_xticks(sizes)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
        powers_of_ten(axes.yaxis)
        axes.set_xlabel(axis)
        axes.set_ylabel("time of an iteration [s]")

    legend = [
        Legend(f"{titles[group]}, p = {exponent(curve):.1f}", number)
        for number, (group, curve) in enumerate(curves.items())
    ]
    data = Sheet(name, ("method", axis, "time [s]", "exponent p"), lines, folded=True)
    return Plot(name, f"Time of an iteration over {axis}", drawn(name, 2.7, draw), data, legend)


def _short(group: str) -> str:
    """The suite, and the method or the class that its options begin with."""
    return group.partition("(")[0]


def exponent(curve: Curve) -> float:
    """Return p of time ~ size^p."""
    x, y = np.log(np.array(curve, dtype=float)).T
    return float(np.polyfit(x, y, 1)[0])
