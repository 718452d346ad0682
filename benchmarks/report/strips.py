"""A distribution as a strip of dots for each method, on one logarithmic axis."""

from collections.abc import Mapping, Sequence
from statistics import median

import numpy as np
from matplotlib.axes import Axes

from benchmarks.report.plot import (
    TEXT,
    as_series,
    colour,
    drawn,
    named_ticks,
    power_of_ten,
    powers_of_ten,
)

_SPREAD = 0.28  # of the dots of a strip, up and down


def strips(
    name: str,
    values: Mapping[str, Sequence[float]],
    colours: Mapping[str, int],
    axis: str,
    floor: float,
    ceiling: float,
    limits: Sequence[float] = (),
) -> str:
    """Draw a strip for each method: a dot a row, a bar at the median.

    Args:
        name: of the plot.
        values: by method, not negative.
        colours: by method, their numbers.
        axis: what the values are, with their unit.
        floor: what is smaller is drawn here.
        ceiling: what is larger is drawn here.
        limits: values to mark by a line.
    """

    def draw(axes: Axes) -> None:
        for place, (method, here) in enumerate(values.items()):
            _strip(axes, place, np.clip(here, floor, ceiling), colours[method])
        for limit in limits:
            axes.axvline(limit, color=TEXT, ls=(0, (2, 3)), lw=0.9, alpha=0.7)
        axes.set_xscale("log")
        largest = max([10.0 * floor, *limits, *(max(here) for here in values.values() if here)])
        axes.set_xlim(floor / 2.5, 2.5 * min(largest, ceiling))
        powers_of_ten(axes.xaxis)
        axes.grid(visible=False, axis="y")
        named_ticks(axes.yaxis, list(values))
        axes.set_ylim(len(values) - 0.4, -0.6)
        right = f", right: ≥ {power_of_ten(ceiling)}" if largest > ceiling else ""
        axes.set_xlabel(f"{axis}; left edge: ≤ {power_of_ten(floor)}{right}")

    return drawn(name, 0.9 + 0.29 * len(values), draw)


def _strip(axes: Axes, place: int, values: np.ndarray, number: int) -> None:
    if not len(values):
        return
    # Spread evenly, in the order of the rows: the same rows give the same picture.
    offsets = _SPREAD * (2.0 * ((0.618034 * np.arange(len(values))) % 1.0) - 1.0)
    style = {"ms": 4.5, "mew": 0.0, "alpha": 0.6, "color": colour(number)}
    dots = axes.plot(values, place + offsets, "o", **style)
    middle = median(values)
    bar = axes.plot([middle, middle], [place - 0.38, place + 0.38], lw=2.2, color=colour(number))
    as_series([*dots, *bar], number)
