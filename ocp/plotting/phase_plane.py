"""The picture of one variable over another: a phase plane, a path on the ground."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from ocp.checks.errors import ProblemError
from ocp.plotting.curve import Curve
from ocp.plotting.picture import (
    COLOURS,
    NO_LABEL,
    Picture,
    finite_range,
    legend,
    wrapped,
    write_title,
)
from ocp.plotting.run import Run
from ocp.plotting.solution import check_comparable, styles
from ocp.plotting.view import named

_MARGIN, _NEAR, _SAME = 0.08, 0.5, 1e-9


def plot_plane(
    title: str, is_success: bool, runs: Mapping[str, Run], plane: Sequence[str]
) -> Picture:
    """Return the picture of two variables of runs, ``plane[1]`` over ``plane[0]``.

    A circle marks the start, a square the end; limits are hatched where they are near.

    Raises:
        ProblemError: if there are not two names, one of them is of nothing, the two are never known
            at the same time, or runs do not compare.
    """
    if isinstance(plane, str) or not isinstance(plane, Sequence) or len(plane) != 2:
        raise ProblemError(f'plot: plane = {plane!r}: two names are needed, plane=("x", "v")')
    check_comparable(runs)
    picture = Picture(figsize=(7.0, 5.2), layout="constrained")
    ax = picture.subplots()
    pairs = [[named(run.problem, run.curves, name)[0] for name in plane] for run in runs.values()]
    for (x, y), style, colour in zip(pairs, styles(runs).values(), COLOURS, strict=False):
        at = np.interp(y.t, x.t, x.values) if len(x.t) != len(y.t) else x.values
        ax.plot(at, y.values, color=colour, linestyle=style.line, linewidth=1.6,
                label=style.label or NO_LABEL)  # fmt: skip
        known = np.flatnonzero(np.isfinite(at) & np.isfinite(y.values))
        if not known.size:
            raise ProblemError(f"plot: {x.name} and {y.name} are never known at the same time")
        for k, marker, name in ((known[0], "o", "start"), (known[-1], "s", "end")):
            ax.plot(at[k], y.values[k], marker, color="black", markersize=6, zorder=3,
                    markerfacecolor="white", linestyle="none", label=name)  # fmt: skip
    first = pairs[0]
    for axis, curve in zip(("x", "y"), first, strict=True):
        _limit(ax, axis, curve, [pair[axis == "y"] for pair in pairs])
    ax.set_xlabel(wrapped(first[0].label, 60))
    ax.set_ylabel(wrapped(first[1].label, 40))
    if first[0].unit and first[0].unit == first[1].unit:
        ax.set_aspect("equal", adjustable="box")
    ax.grid(alpha=0.25, linewidth=0.6)
    legend(ax)
    write_title(picture, title, is_good=is_success)
    picture.show_in(ax, plane)
    return picture


def _limit(ax: Axes, axis: str, curve: Curve, all_runs: Sequence[Curve]) -> None:
    """Set the range of an axis, and hatch what constant limits near it forbid."""
    low, high = finite_range(c.values for c in all_runs)
    reach = _NEAR * (high - low) or 1.0
    ends = [(limit.name, end) for limit in curve.limits for end in (limit.lower, limit.upper)]
    near = {
        float(end[0]): name
        for name, end in ends
        if np.isfinite(end).all()
        and np.ptp(end) <= _SAME * abs(end[0])
        and low - reach <= end[0] <= high + reach
    }
    low, high = min([low, *near]), max([high, *near])
    margin = _MARGIN * (high - low) or 1.0
    low, high = low - margin, high + margin
    (ax.set_xlim if axis == "x" else ax.set_ylim)(low, high)
    line, span = (ax.axvline, ax.axvspan) if axis == "x" else (ax.axhline, ax.axhspan)
    middle = float(np.nanmean(curve.values))
    for end, name in near.items():
        outside = high + margin if end >= middle else low - margin
        line(end, color="0.35", linewidth=0.9, label=name)
        span(*sorted((end, outside)), facecolor="none", edgecolor="0.78", hatch="////", zorder=0.6)
