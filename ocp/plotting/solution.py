"""The picture of one or several solutions: a panel for each variable, with all that limits it."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ocp.checks.errors import ProblemError
from ocp.plotting.curve import Curve
from ocp.plotting.draw_panel import SOLID, Dashes, Drawn, Style, draw_panel
from ocp.plotting.panels import Panel, panels_of
from ocp.plotting.picture import (
    COLOURS,
    NO_LABEL,
    Picture,
    laid_out,
    legend,
    name_axis,
    wrapped,
    write_title,
)
from ocp.plotting.run import Run
from ocp.plotting.view import TIME_UNITS, Abscissa, View

# How several runs are told apart, without a colour too.
_LINES: tuple[Dashes, ...] = (
    SOLID,
    (0, (5, 1.5)),
    (0, (4, 1.2, 1, 1.2)),
    (0, (1.2, 1.2)),
    (0, (8, 2)),
    (0, (3, 1, 1, 1, 1, 1)),
)
_LETTER = 5.2  # width of a letter [pt]


def plot_runs(title: str, is_success: bool, runs: Mapping[str, Run], view: View) -> Picture:
    """Return the picture of runs of one problem, or of several with the same variables.

    Args:
        title: what stands above it.
        is_success: of the first run.
        runs: by what a legend calls each; the first says what is drawn.
        view: what is drawn, and over what.

    Raises:
        ProblemError: if a name is of nothing, the runs have different variables, or are too many.
    """
    check_comparable(runs)
    first = next(iter(runs.values()))
    chosen = view.chosen(first.problem, first.curves)
    if not chosen:
        raise ProblemError(f"plot: '{first.problem}' has nothing to draw")
    panels = panels_of(chosen, apart=len(runs) > 1)
    picture, axes = laid_out([panel.label for panel in panels])
    places = {name: Abscissa.of(view, run.problem, run.curves) for name, run in runs.items()}
    for ax, panel in zip(axes, panels, strict=True):
        draw_panel(ax, _drawn(panel, runs, places))
        legend(ax)
        picture.show_in(ax, [curve.name for curve in panel.curves])
    _finish(picture, axes, next(iter(places.values())))
    if view.against == "time":
        _mark_phases(axes, runs, TIME_UNITS[view.time_unit])
    write_title(picture, title, is_good=is_success)
    if len(runs) > 1:
        _name_runs(picture, runs)
    return picture


def check_comparable(runs: Mapping[str, Run]) -> None:
    """Raise ``ProblemError`` if runs have other variables, or are too many for one picture."""
    first, *others = runs.values()
    for other in others:
        first.same_variables_as(other)
    if len(runs) > len(COLOURS):
        raise ProblemError(f"plot: {len(runs)} solutions in one picture, {len(COLOURS)} at most")


def styles(runs: Mapping[str, Run]) -> dict[str, Style]:
    """Return how each run is drawn."""
    if len(runs) == 1:
        return {name: Style() for name in runs}
    each = zip(runs, _LINES, COLOURS, strict=False)
    return {name: Style(name, line, colour) for name, line, colour in each}


def _drawn(panel: Panel, runs: Mapping[str, Run], places: Mapping[str, Abscissa]) -> list[Drawn]:
    found, of_run = [], styles(runs)
    several = len(panel.curves) > 1
    for k, curve in enumerate(panel.curves):
        for name, run in runs.items():
            style = of_run[name]
            colour = style.colour or COLOURS[k]
            label = curve.name if several else NO_LABEL
            for own in _same(run, curve):
                found.append(Drawn(own, places[name], colour, style.line, label))
    return found


def _same(run: Run, curve: Curve) -> list[Curve]:
    return [c for c in run.curves if (c.role, c.name) == (curve.role, curve.name)]


def _finish(picture: Picture, axes: Sequence[Axes], place: Abscissa) -> None:
    name_axis(axes, place.label)
    known = place.values[np.isfinite(place.values)]
    if place.is_time:
        axes[0].set_xlim(known.min(), known.max())


def _name_runs(picture: Picture, runs: Mapping[str, Run]) -> None:
    """Write below the picture which line is of which run."""
    each = styles(runs).values()
    handles = [Line2D([], [], color=s.colour, linestyle=s.line, linewidth=1.8) for s in each]
    picture.legend(
        handles,
        [wrapped(name, 60) for name in runs],
        loc="outside lower center",
        ncols=min(len(runs), 4),
        frameon=False,
    )


def _mark_phases(axes: Sequence[Axes], runs: Mapping[str, Run], seconds: float) -> None:
    """Draw where phases begin, and name them above each column."""
    first = next(iter(runs.values()))
    if not first.phases:
        return
    edges = first.edges / seconds
    for ax in axes:
        for k in range(0, len(first.phases), 2):
            ax.axvspan(edges[k], edges[k + 1], color="0.5", alpha=0.08, linewidth=0, zorder=0.1)
        for edge in edges[1:-1]:
            ax.axvline(edge, color="0.4", linestyle=(0, (5, 4)), linewidth=0.8, zorder=1)
    rows = axes[0].get_gridspec().nrows  # type: ignore[union-attr]
    for ax in axes[::rows]:
        width = 72.0 * ax.get_figure().get_size_inches()[0] * 0.72 / (-(-len(axes) // rows))  # type: ignore[union-attr]
        rooms = np.diff(edges) / (edges[-1] - edges[0]) * width
        fits = all(room > _LETTER * len(n) for room, n in zip(rooms, first.phases, strict=True))
        for name, middle in zip(first.phases, (edges[1:] + edges[:-1]) / 2, strict=True):
            ax.annotate(
                wrapped(name, 60), (middle, 1.0), (0, 10), xycoords=ax.get_xaxis_transform(),
                textcoords="offset points", ha="center" if fits else "left", va="bottom",
                rotation=0 if fits else 40, fontsize="small", rotation_mode="anchor",
            )  # fmt: skip
