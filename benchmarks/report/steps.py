"""Shares that grow along a logarithmic axis: one staircase for each method."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from benchmarks.report.plot import Legend, Plot, as_series, colour, dashes, drawn, powers_of_ten
from benchmarks.report.sheet import Sheet

_HEIGHT = 2.7  # [inches]


def staircases(
    name: str,
    title: str,
    reached: Mapping[str, Sequence[float]],
    totals: Mapping[str, int],
    colours: Mapping[str, int],
    *,
    axis: str,
    first: float | None = None,
) -> Plot:
    """Draw, over x, the share of a method's rows that are reached at x or before.

    Args:
        name: of the plot.
        title: of the plot.
        reached: by method, where its successful rows are reached, positive.
        totals: by method, how many rows it has.
        colours: by method, their numbers.
        axis: what x is.
        first: where the axis begins; None: below the first step.
    """
    steps = {m: _steps(values, totals[m]) for m, values in reached.items()}
    every = [value for values in reached.values() for value in values]
    left = first or min(every, default=1.0) / 1.3
    right = max(1.3 * max(every, default=1.0), 3.0 * left)

    def draw(axes: Axes) -> None:
        for method, (x, y) in steps.items():
            number = colours[method]
            along, up = [left, *x, right], [0.0, *y, *(y[-1:] or [0.0])]
            style = {"ls": dashes(number), "color": colour(number), "lw": 1.8}
            as_series(axes.step(along, up, where="post", **style), number)
        axes.set_xscale("log")
        axes.set_xlim(left, right)
        axes.set_ylim(-3.0, 103.0)
        powers_of_ten(axes.xaxis)
        axes.set_xlabel(axis)
        axes.set_ylabel("share of the cases [%]")

    lines = [(m, a, b) for m, (x, y) in steps.items() for a, b in zip(x, y, strict=True)]
    data = Sheet(name, ("method", axis, "share [%]"), lines, folded=True)
    # Lines that lie on each other can be told apart by where they end.
    ends = {m: y[-1] if y else 0.0 for m, (_, y) in steps.items()}
    legend = [Legend(f"{m} {ends[m]:.0f}\u00a0%", colours[m]) for m in reached]
    return Plot(name, title, drawn(name, _HEIGHT, draw), data, legend)


def _steps(values: Sequence[float], total: int) -> tuple[list[float], list[float]]:
    """Return where the staircase rises, and to what share [%]."""
    x = np.sort(np.asarray(values, dtype=float))
    y = 100.0 * np.arange(1, len(x) + 1) / max(total, 1)
    return x.tolist(), y.tolist()
