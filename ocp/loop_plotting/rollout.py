"""The picture of a closed loop: what was, was told, wanted and planned, and which rung acted."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from ocp.checks.errors import ProblemError
from ocp.loop_plotting.loop_curves import run_of
from ocp.loop_plotting.loop_record import LoopRecord
from ocp.plotting.phase_plane import plot_plane
from ocp.plotting.picture import Picture
from ocp.plotting.solution import plot_runs
from ocp.plotting.view import TIME_UNITS, View

# Of the sources of an input, told apart by the colour-blind.
COLOURS = {
    "OPTIMAL": "#0072B2",
    "REAL_TIME": "#56B4E9",
    "FEASIBLE": "#009E73",
    "SHIFTED": "#E69F00",
    "LEAST_VIOLATING": "#CC79A7",
    "BACKUP": "#D55E00",
}
_SHADE = 0.3


def plot_rollout(
    rollouts: Mapping[str, LoopRecord], view: View, plane: Sequence[str] | None, plans: int
) -> Picture:
    """Return the picture of loops by name; see ``Rollout.plot``.

    Raises:
        ProblemError: if a loop has no step, or a name is of nothing.
    """
    for rollout in rollouts.values():
        refuse_empty(rollout, "plot")
    runs = {name: run_of(rollout, plans) for name, rollout in rollouts.items()}
    first = next(iter(rollouts.values()))
    if plane is not None:
        return plot_plane(_title(rollouts), not first.ended, runs, plane)
    picture = plot_runs(_title(rollouts), not first.ended, runs, view)
    if len(runs) == 1 and view.against == "time":
        seconds = TIME_UNITS[view.time_unit]
        for axes in picture.axes:
            _shade(axes, first, seconds)
        _name_sources(picture, first)
    return picture


def refuse_empty(rollout: LoopRecord, what: str) -> None:
    """Raise ``ProblemError`` if the loop ended before its first step."""
    if not len(rollout.inputs):
        raise ProblemError(f"{what}: the loop has no step; it ended: {rollout.ended}")


def labels(names: tuple[str, ...], units: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names with their units, where there are any."""
    return tuple(f"{n} [{u}]" for n, u in zip(names, units, strict=True)) if units else names


def _title(rollouts: Mapping[str, LoopRecord]) -> str:
    said = []
    for label, rollout in rollouts.items():
        about = f"{label}: " if label else ""
        worst = rollout.worst or "no limit is violated"
        said.append(f"{about}closed-loop cost {rollout.cost:.6g}; {worst}")
        if rollout.ended:
            said.append(f"ended early: {rollout.ended}")
    name = next(iter(rollouts.values())).plant.name
    return "\n".join((f"{name}: {said[0]}", *said[1:]))


def _shade(axes: Axes, rollout: LoopRecord, seconds: float) -> None:
    """Colour the background where the input is not that of an optimal plan."""
    sources = [rollout.acting(k) for k in range(len(rollout.inputs))]
    names = [source.name if source else "OPTIMAL" for source in sources]
    changes = [k for k in range(1, len(names)) if names[k] != names[k - 1]]
    for first, last in zip([0, *changes], [*changes, len(names)], strict=True):
        if names[first] != "OPTIMAL":
            left, right = rollout.t[[first, last]] / seconds
            axes.axvspan(left, right, color=COLOURS[names[first]], alpha=_SHADE, lw=0, zorder=0.2)


def _name_sources(picture: Picture, rollout: LoopRecord) -> None:
    """Write below the picture which shade is of which source, and how often it decided."""
    total, handles = sum(rollout.counts.values()), []
    for source, count in rollout.counts.items():
        if count:
            colour = "white" if source.name == "OPTIMAL" else COLOURS[source.name]
            words = source.name.lower().replace("_", " ")
            shade = 1.0 if source.name == "OPTIMAL" else _SHADE
            handles.append(
                Patch(facecolor=(colour, shade), edgecolor="0.5", linewidth=0.5,
                      label=f"{words} ({count} of {total})")
            )  # fmt: skip
    picture.legend(
        handles=handles, loc="outside lower center", ncols=min(len(handles), 3), frameon=False,
        title="where the inputs came from", fontsize="small", title_fontsize="small",
    )  # fmt: skip
