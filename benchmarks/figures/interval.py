"""Fig. 2.13: smaller steps of prediction and simulation."""

import numpy as np
from matplotlib.axes import Axes

from benchmarks.figures.drawing import COLOURS, FINITE, Drawing, held, label, sheet
from benchmarks.figures.mpc_runs import BOUND, LARGEST, SETTLED, finite, peak, receding
from ocp import Rollout

_COARSE, _FINE, _DURATION = 0.05, 0.01, 4.0
_SHORT = 5
# Windows of time [s], position [m] and input [N].
_NEAR = ((2.1, 3.0), (-2.06, -0.8), (-7.0, 16.0))
_ALL = ((0.4, _DURATION), (-3.6, 2.3), (-LARGEST, LARGEST))


def smaller_steps() -> Drawing:
    """Draw the approach to the bound with both intervals: same duration, and same N."""
    longer = round(_SHORT * _COARSE / _FINE)
    coarse = receding(_SHORT, dt=_COARSE, duration=_DURATION)
    same_time = receding(longer, dt=_FINE, duration=_DURATION)
    same_count = receding(_SHORT, dt=_FINE, duration=_DURATION)
    ends = [finite(dt=dt, duration=_DURATION) for dt in (_COARSE, _FINE)]
    name = f"dt = {_COARSE:g} s, N = {_SHORT}"
    panels = {
        f"same real-time horizon, {_SHORT * _COARSE:g} s": {
            name: coarse,
            f"dt = {_FINE:g} s, N = {longer}": same_time,
        },
        f"same number of steps, N = {_SHORT}": {
            name: coarse,
            f"dt = {_FINE:g} s, N = {_SHORT}": same_count,
        },
        "finite horizon": {
            f"dt = {_COARSE:g} s, finite": ends[0],
            f"dt = {_FINE:g} s, finite": ends[1],
        },
    }
    picture, columns = sheet(13.0, 6.4), {}
    grid = picture.subplots(2, len(panels), sharex="col")
    for column, (title, runs) in enumerate(panels.items()):
        for (run, loop), colour in zip(runs.items(), (COLOURS[0], FINITE), strict=True):
            _approach(grid[0, column], grid[1, column], loop, run, colour)
            columns |= _columns(run, loop)
        label(grid[0, column], "", "position x_1 [m]", title)
        label(grid[1, column], "time [s]", "input u [N]")
        grid[0, column].legend(fontsize=8, loc="lower left" if column == 1 else "upper right")
        times, positions, inputs = _ALL if column == 1 else _NEAR
        grid[0, column].set(xlim=times, ylim=positions)
        grid[1, column].set(ylim=inputs)
    sentence = (
        f"Fig. 2.13: at the same real-time horizon of {_SHORT * _COARSE:g} s the smaller interval "
        f"takes the largest |u| after {SETTLED:g} s from {peak(coarse):.1f} to "
        f"{peak(same_time):.1f} N and the largest jump of u from {_jump(coarse):.1f} to "
        f"{_jump(same_time):.1f} N (finite horizon: {peak(ends[0]):.1f} to {peak(ends[1]):.1f} N, "
        f"jump {_jump(ends[0]):.1f} to {_jump(ends[1]):.1f} N). At the same N = {_SHORT} it is the "
        f"other way round: {peak(coarse):.1f} to {peak(same_count):.1f} N, since the horizon is "
        f"five times shorter. Chosen here: reference as in Fig. 2.10, runs of {_DURATION:g} s, "
        "weights not scaled by dt."
    )
    return Drawing(picture, columns, sentence)


def _approach(above: Axes, below: Axes, loop: Rollout, name: str, colour: str) -> None:
    above.plot(loop.t, loop.x[:, 0], color=colour, label=name)
    for bound in (-BOUND, BOUND):
        above.axhline(bound, color="tab:red", lw=1.0)
    held(below, loop.t, loop.inputs[:, 0], color=colour, label=name)


def _columns(name: str, loop: Rollout) -> dict[str, np.ndarray]:
    return {
        f"t, {name} [s]": loop.t,
        f"x_1, {name} [m]": loop.x[:, 0],
        f"u, {name} [N]": loop.inputs[:, 0],
    }


def _jump(loop: Rollout) -> float:
    """Largest change of u from one interval to the next, after the first half second."""
    late = loop.inputs[loop.t[:-1] >= SETTLED - 1e-9, 0]
    return float(np.abs(np.diff(late)).max())
