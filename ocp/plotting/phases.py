"""Figure of a solution of phases: states, controls and costates over the time of all."""

from collections.abc import Sequence

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ocp.plotting.solution import (
    Panel,
    PlottableSolution,
    controls,
    costates,
    decorate,
    draw_lines,
    states,
)

# As many colours are told apart.
_COLOURS = 10


def plot_phases(title: str, phases: Sequence[PlottableSolution], names: Sequence[str]) -> Figure:
    """Return a figure of phases one after another; what has one name has one colour.

    Args:
        title: what stands above it.
        phases: the solution of each, on its own clock.
        names: of the phases.
    """
    kinds = (states, controls, costates)
    rows = [[kind(phase) for phase in phases] for kind in kinds]
    figure = Figure(figsize=(9.0, 1.0 + 2.1 * len(rows)), layout="constrained")
    axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for panels, ax in zip(rows, axes, strict=True):
        _draw(ax, panels)
        for phase in phases[1:]:
            ax.axvline(phase.t[0], color="0.4", linestyle=(0, (5, 4)), linewidth=0.8)
    for name, phase in zip(names, phases, strict=True):
        axes[0].text(
            float(phase.t[[0, -1]].mean()),
            1.02,
            name,
            ha="center",
            va="bottom",
            transform=axes[0].get_xaxis_transform(),
        )
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(phases[0].t[0], phases[-1].t[-1])
    figure.suptitle(title, fontsize="large")
    figure.align_ylabels()
    return figure


def _draw(ax: Axes, panels: Sequence[Panel]) -> None:
    """Draw the panels of all phases in one place; a name stands in the legend once."""
    names = list(dict.fromkeys(name for panel in panels for name in panel.names))
    colour = {name: colormaps["tab10"](i % _COLOURS) for i, name in enumerate(names)}
    seen: set[str] = set()
    for panel in panels:
        labels = ["_" * (name in seen) + name for name in panel.names]
        draw_lines(ax, panel, [colour[name] for name in panel.names], labels)
        seen.update(panel.names)
    decorate(ax, panels[0].title, len(names))
