"""The figure of a closed loop: states, inputs and running cost over time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ocp.checks.errors import ProblemError
from ocp.loop_plotting.loop_record import LoopRecord

# Of the sources of an input.
COLOURS = {
    "OPTIMAL": "#2f7fb8",
    "REAL_TIME": "#5b5fc7",
    "FEASIBLE": "#3aa98f",
    "SHIFTED": "#e8710a",
    "LEAST_VIOLATING": "#a0429e",
    "BACKUP": "tab:red",
}


def plot_rollout(rollout: LoopRecord) -> Figure:
    """Return states, inputs and running cost over time; the shade says where an input is from.

    Raises:
        ProblemError: if the loop has no step.
    """
    refuse_empty(rollout, "plot")
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    states, inputs, costs = figure.subplots(3, 1, sharex=True)
    model = rollout.plant.model
    for name, column in zip(labels(model.x_names, model.x_units), rollout.x.T, strict=True):
        states.plot(rollout.t, column, label=name)
    edges = rollout.t[: len(rollout.inputs) + 1]
    for name, column in zip(labels(model.u_names, model.u_units), rollout.inputs.T, strict=True):
        inputs.step(edges, np.append(column, column[-1:]), where="post", label=name)
    costs.step(edges[:-1], rollout.costs / np.diff(edges), where="post", color="black")
    for axes, label in ((states, "states"), (inputs, "inputs"), (costs, "running cost")):
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        _shade(axes, rollout)
    for axes in (states, inputs):
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    costs.set_xlabel("time [s]")
    worst = f"; {rollout.worst}" if rollout.worst else ""
    figure.suptitle(
        f"{rollout.plant.name}: closed-loop cost {rollout.cost:.6g}{worst}\n"
        f"decisions: {rollout.decided_by}",
        fontsize=10,
    )
    return figure


def refuse_empty(rollout: LoopRecord, what: str) -> None:
    """Raise ``ProblemError`` if the loop ended before its first step."""
    if not len(rollout.inputs):
        raise ProblemError(f"{what}: the loop has no step; it ended: {rollout.ended}")


def labels(names: tuple[str, ...], units: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names with their units, where there are any."""
    return tuple(f"{n} [{u}]" for n, u in zip(names, units, strict=True)) if units else names


def _shade(axes: Axes, rollout: LoopRecord) -> None:
    """Colour the background where the input is not that of an optimal plan."""
    for k in range(len(rollout.inputs)):
        source = rollout.acting(k)
        if source and source.name != "OPTIMAL":
            left, right = rollout.t[k], rollout.t[k + 1]
            axes.axvspan(left, right, color=COLOURS[source.name], alpha=0.25, lw=0)
