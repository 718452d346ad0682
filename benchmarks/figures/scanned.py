"""How the scan of a self-motion is drawn: a row of axes above the place of the end on it."""

import numpy as np
from matplotlib.axes import Axes

from benchmarks.figures.drawing import COLOURS, FINITE, label
from ocp import Solution
from solvers import Enumeration
from solvers.internal import InvariantManifold, Scan

PLACE = "place of θ(t_1) on its self-motion, arclength [rad]"


def transversality(found: Enumeration) -> np.ndarray:
    """‖N ψ(t0)‖ at every point of the scan."""
    (scan,) = found.scans
    ocp = found.solutions[0].problem
    start = InvariantManifold.of(ocp).at(0.0, ocp.parameter_values().at(0.0)[0])
    rows = zip(scan.starts, scan.costates, strict=True)
    return np.array([np.linalg.norm(start.projector(x) @ psi) for x, psi in rows])


def rows(axes: np.ndarray, scan: Scan, norms: np.ndarray, name: str, found: Enumeration) -> None:
    """Draw end configuration, cost and what has to vanish, with the extremals in both."""
    for i, (column, colour) in enumerate(zip(scan.ends.T, COLOURS, strict=False)):
        axes[0].plot(scan.arc, np.degrees(column), color=colour, label=f"θ_{i + 1}(t_1)")
    axes[0].legend(fontsize=8)
    axes[1].plot(scan.arc, scan.costs, color=COLOURS[0])
    axes[2].plot(scan.arc, norms, color=COLOURS[0])
    for solution in found.solutions:
        arc = place(scan, solution)
        marker = style(solution, found)
        axes[1].plot(arc, solution.cost, **marker)
        axes[2].plot(arc, 0.0, **marker)
    axes[1].legend(*once(axes[1]), fontsize=8)
    label(axes[0], "", "end configuration [deg]")
    label(axes[1], "", "cost [rad²/s]")
    label(axes[2], PLACE, name)


def style(solution: Solution, found: Enumeration) -> dict:
    """Return how an extremal is marked."""
    minimum = any(solution is other for other in found.minima)
    return {
        "marker": "o" if minimum else "x",
        "color": FINITE if minimum else "tab:red",
        "ms": 8,
        "ls": "",
        "clip_on": False,
        "zorder": 5,
        "label": "minimum (second-order test)" if minimum else "extremal, no minimum",
    }


def once(axes: Axes) -> tuple[list, list]:
    """Return handles and names for a legend that names each kind once."""
    handles, names = axes.get_legend_handles_labels()
    first = {name: handle for handle, name in reversed(list(zip(handles, names, strict=True)))}
    return list(first.values()), list(first)


def place(scan: Scan, solution: Solution) -> float:
    """Arclength at the end of a solution."""
    away = scan.curve.manifold.periods.wrapped(scan.ends - solution.x[-1])
    return float(scan.arc[np.argmin(np.linalg.norm(away, axis=1))])


def columns(scan: Scan, more: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the data of a scan, and more beside it."""
    data = {"arclength [rad]": scan.arc}
    data |= {f"θ_{i + 1}(t_1) [rad]": column for i, column in enumerate(scan.ends.T)}
    data |= {f"θ_{i + 1}(t_0) [rad]": column for i, column in enumerate(scan.starts.T)}
    return data | {"cost [rad²/s]": scan.costs} | more
