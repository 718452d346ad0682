"""The animation of a closed loop: what happened so far, and what is planned next."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ocp.checks.arguments import check_callable, check_instance, check_positive, check_whole
from ocp.checks.errors import ProblemError
from ocp.checks.progress import Progress, told
from ocp.files.draft import replacing
from ocp.loop_plotting.loop_record import Draw, LoopRecord
from ocp.loop_plotting.plans import controls_ahead, plans_of, sends_controls, states_ahead
from ocp.loop_plotting.rollout import COLOURS, labels, refuse_empty
from ocp.solution.solution import Solution

_DPI = 80
# How long the end stays [s]; more frames than so many are a mistake.
_STAYS, _MOST = 0.5, 3000
# The file format counts hundredths of a second, and viewers show no frame for less than two.
_FASTEST = 50


def animate_rollout(
    rollout: LoopRecord,
    path: str | Path,
    *,
    draw: Draw | None = None,
    frames_per_second: int = 20,
    speed: float = 1.0,
    progress: Progress | None = None,
) -> Path:
    """Write a GIF; see ``Rollout.animate``."""
    check_instance(path, (str, Path), "the path of an animation")
    path, times = Path(path), _times(rollout, frames_per_second, speed)
    if path.suffix != ".gif":
        raise ProblemError(f"animation: {path} is no .gif file")
    if draw is not None:
        check_callable(draw, "animation: draw")
    report = told(progress, "animation")
    film = _Film.of(rollout, draw)
    film.show(float(times[0]))
    film.figure.draw_without_rendering()
    film.figure.set_layout_engine(None)  # from here on the axes stay where they are
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = PillowWriter(fps=frames_per_second)
    with replacing(path) as draft, writer.saving(film.figure, str(draft), _DPI):
        for k, t in enumerate(times):
            film.show(float(t))
            writer.grab_frame()
            report(k + 1, len(times))
        for _ in range(int(_STAYS * frames_per_second)):
            writer.grab_frame()
    return path


def _times(rollout: LoopRecord, frames_per_second: int, speed: float) -> np.ndarray:
    """Return the instants that are shown [s]."""
    refuse_empty(rollout, "animation")
    if not 1 <= check_whole(frames_per_second, "animation: frames per second") <= _FASTEST:
        raise ProblemError(
            f"animation: {frames_per_second} frames per second, a GIF shows 1 to {_FASTEST}"
        )
    check_positive(speed, "animation: speed")
    first, last = rollout.t[0], rollout.t[-1]
    count = max(2, round((last - first) / speed * frames_per_second) + 1)
    if count > _MOST:
        raise ProblemError(
            f"animation: {count} frames, at most {_MOST}: ask for a larger speed or fewer a second"
        )
    return np.linspace(first, last, count)


@dataclass(frozen=True, eq=False)
class _AnimatedPanel:
    """Axes with two lines a quantity: what it was, and what it is planned to be.

    Attributes:
        axes: where.
        t: instants (K + 1,) [s].
        rows: values at them (K + 1, n).
        is_held: whether a value stays until the next instant.
        planned: (plan, from when on) -> instants and values of what is left of it; None: the
            plan says nothing about these quantities.
    """

    axes: Axes
    t: np.ndarray
    rows: np.ndarray
    is_held: bool
    planned: Callable[[Solution, float], tuple[np.ndarray, np.ndarray]] | None
    past: list[Line2D] = field(default_factory=list)
    ahead: list[Line2D] = field(default_factory=list)
    now: list[Line2D] = field(default_factory=list)

    def prepare(self, what: str, names: tuple[str, ...], plans: list[Solution], end: float) -> None:
        """Draw everything once, without values, within limits that everything fits into."""
        style = "steps-post" if self.is_held else "default"
        for name in names:
            (line,) = self.axes.plot([], [], drawstyle=style, label=name)
            self.past.append(line)
            (dashed,) = self.axes.plot([], [], "--", lw=1.0, color=line.get_color())
            self.ahead.append(dashed)
        self.now.append(self.axes.axvline(self.t[0], color="0.3", lw=0.8))
        shown = [self.rows]
        if self.planned:
            shown += [self.planned(plan, -np.inf)[1] for plan in plans]
        values = np.concatenate([rows.ravel() for rows in shown])
        values = values[np.isfinite(values)]
        low, high = values.min(initial=0.0), values.max(initial=0.0)
        margin = 0.06 * (high - low) or 1.0
        self.axes.set_xlim(self.t[0], end)
        self.axes.set_ylim(low - margin, high + margin)
        self.axes.set_ylabel(what)
        self.axes.grid(alpha=0.3)
        self.axes.legend(
            self.past, list(names), fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5)
        )

    def show(self, t: float, plan: Solution | None) -> None:
        """Draw what was until t [s], and what a plan says from then on."""
        until = np.append(self.t[self.t < t], t)
        at_end = self.rows[np.searchsorted(self.t, t, side="right") - 1]
        if not self.is_held:
            at_end = _between(self.t, self.rows, t)
        rows = np.vstack([self.rows[: len(until) - 1], at_end])
        times, ahead = np.empty(0), np.empty((0, len(self.past)))
        if plan and self.planned:
            times, ahead = self.planned(plan, t)
        for i, (line, dashed) in enumerate(zip(self.past, self.ahead, strict=True)):
            line.set_data(until, rows[:, i])
            dashed.set_data(times, ahead[:, i])
        self.now[0].set_xdata([t, t])


@dataclass(frozen=True, eq=False)
class _Film:
    """The figure and what moves in it."""

    rollout: LoopRecord
    figure: Figure
    panels: tuple[_AnimatedPanel, ...]
    scene: Axes | None
    draw: Draw | None

    @classmethod
    def of(cls, rollout: LoopRecord, draw: Draw | None) -> "_Film":
        """Lay the figure out: the scene to the left where there is one."""
        figure = Figure(figsize=(11.0 if draw else 7.0, 5.0), dpi=_DPI, layout="constrained")
        grid = figure.add_gridspec(2, 2 if draw else 1)
        upper = figure.add_subplot(grid[0, -1])
        lower = figure.add_subplot(grid[1, -1], sharex=upper)
        scene = figure.add_subplot(grid[:, 0]) if draw else None
        model, plans = rollout.plant.model, plans_of(rollout)
        inputs = np.vstack([rollout.inputs, rollout.inputs[-1:]])
        is_same = all(plan.x.shape[1] == model.nx for plan in plans)
        states = _AnimatedPanel(
            upper, rollout.t, rollout.x, False, states_ahead if is_same else None
        )
        sent = _AnimatedPanel(lower, rollout.t[: len(inputs)], inputs, True,
                      controls_ahead if sends_controls(rollout) else None)  # fmt: skip
        end = max([rollout.t[-1], *(plan.t[-1] for plan in plans)])
        states.prepare("states", labels(model.x_names, model.x_units), plans, end)
        sent.prepare("inputs", labels(model.u_names, model.u_units), plans, end)
        lower.set_xlabel("time [s]")
        return cls(rollout, figure, (states, sent), scene, draw)

    def show(self, t: float) -> None:
        """Draw an instant [s]."""
        rollout = self.rollout
        k = min(int(np.searchsorted(rollout.t, t, side="right")), len(rollout.inputs)) - 1
        decision = rollout.decisions[k] if rollout.decisions else None
        for panel in self.panels:
            panel.show(t, decision.plan if decision else None)
        source = rollout.acting(k)
        said, colour = "decided before", "0.3"
        if source:
            said, colour = source.name.lower(), COLOURS[source.name]
        self.figure.suptitle(f"{rollout.plant.name}: t = {t:.2f} s, {said}", color=colour)
        if self.scene and self.draw:
            self.scene.clear()
            self.draw(self.scene, _between(rollout.t, rollout.x, t), t)


def _between(t: np.ndarray, rows: np.ndarray, at: float) -> np.ndarray:
    return np.array([np.interp(at, t, column) for column in rows.T])
