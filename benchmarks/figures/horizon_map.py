"""Fig. 2.14: what number of steps and interval do together, as a map of computed runs."""

from functools import cache
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from benchmarks.figures.drawing import Drawing, sheet
from benchmarks.figures.mpc_runs import BOUND, SETTLED, peak, receding
from models import mass_spring_damper, sinusoid
from ocp import Rollout

_INTERVALS = (0.4, 0.2, 0.1, 0.05, 0.025)
_LENGTHS = (0.2, 0.4, 0.8, 1.6)
_DURATION = 4.0
_WITHIN = 0.005  # the plant is looked at this often between two samples [s]


class _Cell(NamedTuple):
    steps: int
    peak: float
    outside: float
    error: float


def horizon_and_interval() -> Drawing:
    """Draw maps of input, violation between the samples and tracking error."""
    cells = {
        (length, dt): _cell(length, dt)
        for length in _LENGTHS
        for dt in _INTERVALS
        if length >= dt - 1e-9
    }
    picture = sheet(13.0, 4.9)
    axes = picture.subplots(1, 3)
    _map(axes[0], {k: c.peak for k, c in cells.items()}, f"largest |u| after {SETTLED:g} s [N]",
         "{:.1f}")  # fmt: skip
    _map(axes[1], {k: 1e3 * c.outside for k, c in cells.items()},
         "|x_1| beyond its bound between samples [mm]", "{:.1f}")  # fmt: skip
    _map(axes[2], {k: c.error for k, c in cells.items()},
         "rms distance from the clipped reference [m]", "{:.2f}")  # fmt: skip
    for place, (length, dt) in _places().items():
        if (length, dt) in cells:
            axes[0].text(place[0], place[1] - 0.3, f"N = {cells[length, dt].steps}", ha="center",
                         va="center", fontsize=7)  # fmt: skip
    short, long, fine, coarse = _LENGTHS[0], _LENGTHS[-1], _INTERVALS[-1], _INTERVALS[0]
    beyond = cells[long, coarse].outside, cells[long, fine].outside
    sentence = (
        f"Fig. 2.14: with dt = {fine:g} s a real-time horizon of {long:g} s instead of {short:g} s "
        f"takes the largest |u| from {cells[short, fine].peak:.1f} to {cells[long, fine].peak:.1f} "
        f"N; at {long:g} s, dt = {coarse:g} s instead of {fine:g} s misses what happens between "
        f"the samples ({1e3 * beyond[0]:.1f} instead of {1e3 * beyond[1]:.1f} mm beyond the bound) "
        f"and saves {cells[long, fine].steps - cells[long, coarse].steps} of "
        f"{cells[long, fine].steps} steps N. Chosen here: reference as in Fig. 2.10, runs of "
        f"{_DURATION:g} s, weights not scaled by dt; grey: the horizon is shorter than one step."
    )
    return Drawing(picture, _columns(cells), sentence)


@cache
def _cell(length: float, dt: float) -> _Cell:
    steps = round(length / dt)
    loop = receding(steps, dt=dt, duration=_DURATION)
    t, x = _between(loop, dt)
    target = np.clip(sinusoid(t)[:, 0], -BOUND, BOUND)
    late = t >= SETTLED
    error = np.sqrt(np.mean((x[late, 0] - target[late]) ** 2))
    outside = max(np.abs(x[:, 0]).max() - BOUND, 0.0)
    return _Cell(steps, peak(loop), float(outside), float(error))


def _between(loop: Rollout, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """The plant between the samples: exact, the input is held."""
    plant, parts = mass_spring_damper().sampled(_WITHIN), round(dt / _WITHIN)
    x = [loop.x[0]]
    for u in np.repeat(loop.inputs, parts, axis=0):
        x.append(plant.A @ x[-1] + plant.B @ u)
    return _WITHIN * np.arange(len(x)), np.array(x)


def _places() -> dict[tuple[int, int], tuple[float, float]]:
    return {
        (i, j): (length, dt) for i, length in enumerate(_LENGTHS) for j, dt in enumerate(_INTERVALS)
    }


def _map(axes: Axes, values: dict[tuple[float, float], float], title: str, form: str) -> None:
    table = np.full((len(_INTERVALS), len(_LENGTHS)), np.nan)
    for (i, j), key in _places().items():
        table[j, i] = values.get(key, np.nan)
    axes.set_facecolor("lightgray")
    top = np.nanmax(table)
    axes.imshow(table, origin="lower", cmap="YlOrRd", aspect="auto", vmin=0.0, vmax=1.4 * top)
    for (i, j), key in _places().items():
        if key in values:
            axes.text(i, j, form.format(values[key]), ha="center", va="center", fontsize=9)
    axes.set_xticks(range(len(_LENGTHS)), [f"{length:g}" for length in _LENGTHS])
    axes.set_yticks(range(len(_INTERVALS)), [f"{dt:g}" for dt in _INTERVALS])
    axes.set_xlabel("real-time horizon N dt [s]")
    axes.set_ylabel("interval dt [s]")
    axes.set_title(title, fontsize=10)


def _columns(cells: dict[tuple[float, float], _Cell]) -> dict[str, np.ndarray]:
    numbers = np.array([[length, dt, *cell] for (length, dt), cell in cells.items()])
    names = (
        "real-time horizon [s]",
        "dt [s]",
        "N [steps]",
        "largest |u| after 0.5 s [N]",
        "|x_1| beyond its bound between samples [m]",
        "rms distance from the clipped reference [m]",
    )
    return dict(zip(names, numbers.T, strict=True))
