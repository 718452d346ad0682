"""An arm's motion among obstacles as an animated GIF."""

from collections.abc import Sequence
from pathlib import Path

import casadi as ca
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

from benchmarks.pictures.arm_drawing import draw_obstacles, metres
from models import Obstacle, PlanarArm
from ocp.internal import replacing

_DPI = 80
_LAST = 12  # frames that the last posture stays


def animate(
    arm: PlanarArm,
    t: np.ndarray,
    theta: np.ndarray,
    file: Path,
    *,
    obstacles: Sequence[Obstacle] = (),
    symbol: ca.SX | None = None,
    influence: float | None = None,
    title: str = "",
    frames_per_second: int = 20,
) -> Path:
    """Write a motion, in real time, to a GIF and return the file.

    Args:
        arm: who moves.
        t: instants (N + 1,) [s].
        theta: joint angles (N + 1, n) [rad].
        file: to write, its folder is made.
        obstacles: at rest or moving.
        symbol: the symbol of time in the position of the moving ones.
        influence: d_m [m], drawn as a pale band around each.
        title: above the picture.
        frames_per_second: of the GIF.
    """
    count = max(2, round((t[-1] - t[0]) * frames_per_second) + 1)
    times = np.linspace(t[0], t[-1], count)
    angles = np.stack([np.interp(times, t, column) for column in theta.T], axis=1)
    postures = arm.positions(angles)
    figure = Figure(figsize=(6.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    reach = sum(arm.lengths)
    axes.set_xlim(arm.base[0] - 0.5 * reach, arm.base[0] + 1.1 * reach)
    axes.set_ylim(arm.base[1] - 0.6 * reach, arm.base[1] + 1.0 * reach)
    metres(axes)
    axes.set_aspect("equal", adjustable="box")
    (links,) = axes.plot([], [], "-o", color="tab:blue", lw=3)
    (trace,) = axes.plot([], [], color="black", lw=1.5)
    shown: list = []

    def draw(frame: int) -> list:
        k = min(frame, count - 1)
        while shown:
            shown.pop().remove()
        shown.extend(draw_obstacles(axes, obstacles, influence, t=symbol, at=float(times[k])))
        links.set_data(*postures[k].T)
        trace.set_data(*postures[: k + 1, -1].T)
        axes.set_title(f"{title}  t = {times[k]:.2f} s".strip(), fontsize=10)
        return [links, trace, *shown]

    file.parent.mkdir(parents=True, exist_ok=True)
    film = FuncAnimation(figure, draw, frames=count + _LAST, blit=False)
    with replacing(file) as draft:
        film.save(str(draft), writer=PillowWriter(fps=frames_per_second), dpi=_DPI)
    return file
