"""Fig. 2.10 to 2.12: constrained linear MPC behind a reference that exceeds the bound."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Picture

from benchmarks.figures.drawing import COLOURS, FINITE, REFERENCE, Drawing, held, label, sheet
from benchmarks.figures.mpc_runs import (
    BOUND,
    DURATION,
    HORIZONS,
    LARGEST,
    SETTLED,
    all_runs,
    peak,
    when,
)
from models import sinusoid
from ocp import Rollout

_CHOSEN = (
    f"Chosen here: w = 3 sin(2 pi t / 4) m and its velocity as reference, start at rest, "
    f"N = {', '.join(map(str, HORIZONS))} and the finite horizon of {DURATION:g} s, dt = 0.05 s."
)
_PALETTE = (*COLOURS, FINITE)
_SECOND = (2.1, 3.7)  # the second approach, to -2 [s]


def positions() -> Drawing:
    """Draw the positions behind the reference."""
    runs = all_runs()
    picture, columns = _states(runs, 0, "position x_1 [m]", "x_1")
    axes = picture.axes[0]
    for bound in (-BOUND, BOUND):
        axes.axhline(bound, color="tab:red", lw=1.0)
    axes.annotate("bound", (0.0, BOUND), xytext=(2, 3), textcoords="offset points",
                  color="tab:red", fontsize=8)  # fmt: skip
    far = max(np.abs(loop.x[:, 0]).max() for loop in runs.values())
    hard = max(np.abs(loop.inputs).max() for loop in runs.values())
    sentence = (
        f"Fig. 2.10: the position follows the reference to the bound of {BOUND:g} m and waits "
        f"there; at the steps of all runs |x_1| exceeds it by {max(far - BOUND, 0.0):.0e} m at "
        f"most, and |u| is at most {hard:.1f} of the {LARGEST:g} N that are allowed. {_CHOSEN}"
    )
    return Drawing(picture, columns, sentence)


def velocities() -> Drawing:
    """Draw the velocities."""
    runs = all_runs()
    picture, columns = _states(runs, 1, "velocity x_2 [m/s]", "x_2")
    short, long = runs["N = 5"], runs["finite horizon"]
    slow = max(_speed_at_bound(loop) for loop in runs.values())
    (hard, late), (soft, early) = _braking(short), _braking(long)
    sentence = (
        f"Fig. 2.11: within 1 cm of its bound the mass moves at {slow:.2f} m/s at most; on its way "
        f"to -2 m it brakes with {hard:.1f} m/s^2 at {late:.2f} s with N = 5, with {soft:.1f} "
        f"m/s^2 at {early:.2f} s with the finite horizon, at most. {_CHOSEN}"
    )
    return Drawing(picture, columns, sentence)


def approach() -> Drawing:
    """Draw the approach to the second constraint, and how large the inputs get."""
    runs, still = all_runs(), all_runs(moving=False)
    picture = sheet(12.0, 8.0)
    near, whole, inputs, bars = picture.subplots(2, 2).flat
    for (name, loop), colour in zip(runs.items(), _PALETTE, strict=True):
        near.plot(loop.t, loop.x[:, 0], ".-", ms=4, color=colour, label=name)
        held(inputs, loop.t, loop.inputs[:, 0], color=colour, label=name)
    near.axhline(-BOUND, color="tab:red", lw=1.0)
    near.set_ylim(-2.06, -0.6)
    inputs.set_ylim(-5.0, 17.0)
    for axes in (near, inputs):
        axes.set_xlim(*_SECOND)
    label(near, "time [s]", "position x_1 [m]", "approaching x_1 = -2 m")
    near.legend(fontsize=8)
    label(inputs, "time [s]", "input u [N]", "the input meanwhile")
    _whole(whole, runs)
    _bars(bars, runs, still)
    short, long = peak(runs["N = 5"]), peak(runs["finite horizon"])
    short_0, long_0 = peak(still["N = 5"]), peak(still["finite horizon"])
    start_0 = np.abs(still["finite horizon"].inputs).max()
    sentence = (
        f"Fig. 2.12: with N = 5 the mass brakes late and hard: largest |u| after the first "
        f"{SETTLED:g} s {short:.1f} N, with the finite horizon {long:.1f} N, ratio "
        f"{short / long:.2f}. A zero velocity reference turns this round: {short_0:.1f} N against "
        f"{long_0:.1f} N ({start_0:.1f} N from the start on). {_CHOSEN}"
    )
    columns = _columns(runs)
    for (name, loop), other in zip(runs.items(), still.values(), strict=True):
        columns[f"x_1, {name} [m]"] = loop.x[:, 0]
        columns[f"u, {name} [N]"] = loop.inputs[:, 0]
        columns[f"u, {name}, zero velocity reference [N]"] = other.inputs[:, 0]
    return Drawing(picture, columns, sentence)


def _states(
    runs: dict[str, Rollout], i: int, axis: str, name: str
) -> tuple[Picture, dict[str, np.ndarray]]:
    picture, columns = sheet(11.0, 4.8), _columns(runs)
    axes, t = picture.subplots(), columns["t [s]"]
    axes.plot(t, sinusoid(t)[:, i], label="reference", **REFERENCE)
    for (run, loop), colour in zip(runs.items(), _PALETTE, strict=True):
        axes.plot(loop.t, loop.x[:, i], color=colour, label=run)
        columns[f"{name}, {run} {axis.rsplit(' ', 1)[1]}"] = loop.x[:, i]
    label(axes, "time [s]", axis)
    axes.set_xlim(0.0, DURATION)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return picture, columns


def _columns(runs: dict[str, Rollout]) -> dict[str, np.ndarray]:
    t = runs["N = 5"].t
    w = sinusoid(t)
    return {"t [s]": t, "reference x_1 [m]": w[:, 0], "reference x_2 [m/s]": w[:, 1]}


def _whole(axes: Axes, runs: dict[str, Rollout]) -> None:
    for name, colour in (("N = 5", COLOURS[0]), ("finite horizon", FINITE)):
        loop = runs[name]
        held(axes, loop.t, loop.inputs[:, 0], color=colour, lw=1.2, label=name)
        k = int(np.argmin(np.abs(loop.t - when(loop))))
        axes.plot(loop.t[k], loop.inputs[k, 0], "o", mfc="none", ms=9, color=colour)
    axes.axvspan(0.0, SETTLED, color="gray", alpha=0.15, lw=0)
    axes.set_xlim(0.0, DURATION)
    label(axes, "time [s]", "input u [N]", "shortest and finite horizon (circle: |u| is largest)")
    axes.legend(fontsize=8, loc="upper right")


def _bars(axes: Axes, runs: dict[str, Rollout], still: dict[str, Rollout]) -> None:
    place = np.arange(len(runs))
    for shift, some, name, colour in (
        (-0.2, runs, "reference with its velocity", COLOURS[1]),
        (0.2, still, "zero velocity reference", "lightgray"),
    ):
        shown = axes.bar(place + shift, [peak(r) for r in some.values()], 0.38, label=name,
                         color=colour)  # fmt: skip
        axes.bar_label(shown, fmt="%.1f", fontsize=8)
    axes.set_xticks(place, list(runs))
    axes.set_ylim(0.0, 19.0)
    label(axes, "", "largest |u| [N]", f"after the first {SETTLED:g} s")
    axes.legend(fontsize=8, loc="upper right", ncols=2)


def _speed_at_bound(loop: Rollout) -> float:
    """Largest speed within 1 cm of the bound [m/s]."""
    near = np.abs(loop.x[:, 0]) >= BOUND - 0.01
    return float(np.abs(loop.x[near, 1]).max())


def _braking(loop: Rollout) -> tuple[float, float]:
    """Largest deceleration on the way to -2 m [m/s^2], and when it begins [s]."""
    rate = np.diff(loop.x[:, 1]) / np.diff(loop.t)
    there = (loop.t[:-1] >= 2.0) & (loop.t[:-1] <= 3.0)
    k = int(np.argmax(np.where(there, rate, -np.inf)))
    return float(rate[k]), float(loop.t[k])
