"""How an arm among obstacles is drawn, wherever it is."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon as Patch

from models import Obstacle

_OBSTACLE = "tab:red"


def draw_obstacles(
    axes: Axes,
    obstacles: Sequence[Obstacle],
    influence: float | None = None,
    *,
    t: ca.SX | None = None,
    at: float = 0.0,
    shade: float = 1.0,
) -> list[Patch]:
    """Draw obstacles of any shape where they are at a time, and return what was drawn.

    Args:
        axes: to draw on.
        obstacles: whose outline is filled.
        influence: d_m [m], drawn as a pale band around each.
        t: the symbol of time [s] that moves them.
        at: the time [s].
        shade: 1: as dark as usual; less: paler, for an earlier instant.
    """
    drawn = []
    for obstacle in obstacles:
        if influence is not None:
            wide = obstacle.outline(influence - obstacle.radius, t=t, at=at)
            drawn.append(Patch(wide, color=_OBSTACLE, alpha=0.1 * shade, lw=0))
        drawn.append(Patch(obstacle.outline(t=t, at=at), color=_OBSTACLE, alpha=0.55 * shade, lw=0))
    for patch in drawn:
        axes.add_patch(patch)
    return drawn


def draw_postures(axes: Axes, postures: np.ndarray, label: str = "", **style: object) -> None:
    """Draw postures (K, n + 1, 2) [m], later ones darker, and the path of the end effector."""
    count = len(postures)
    look: dict[str, Any] = {"color": "tab:blue", "lw": 2, "ms": 3, **style}
    for i, posture in enumerate(postures):
        shade = 0.15 + 0.85 * i / max(1, count - 1)
        look["label"] = label if i == count - 1 else ""
        axes.plot(*posture.T, "-o", alpha=shade, **look)
    axes.plot(*postures[:, -1].T, color="black", lw=1.5)
    axes.plot(*postures[0, 0], "s", color="black", ms=7)


def metres(axes: Axes) -> None:
    """Give both axes the same scale and their names."""
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
