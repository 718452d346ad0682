"""What ``plot`` of a solution, and of one with phases, draws: where both begin."""

from collections.abc import Mapping, Sequence

import numpy as np

from ocp.plotting.phase_plane import plot_plane
from ocp.plotting.picture import Picture
from ocp.plotting.plottable import Pictured
from ocp.plotting.run import Run
from ocp.plotting.solution import plot_runs
from ocp.plotting.view import View

# More unknown constants than so many are no title.
_MOST_UNKNOWNS = 6


def plot(
    solutions: Mapping[str, Pictured], view: View, plane: Sequence[str] | None = None
) -> Picture:
    """Return the picture of solutions, by what a legend calls them; see ``Solution.plot``."""
    runs = {label: Run.of(s.name, s.phases, s.names) for label, s in solutions.items()}
    first = next(iter(solutions.values()))
    if plane is not None:
        return plot_plane(_title(solutions), first.status.is_success, runs, plane)
    return plot_runs(_title(solutions), first.status.is_success, runs, view)


def _title(solutions: Mapping[str, Pictured]) -> str:
    """Say what was found: cost and status of each, and the constants that were chosen."""
    said = []
    for label, s in solutions.items():
        about = f"{label}: " if label else ""
        said.append(f"{about}{s.status.words}, cost {s.cost:.6g}")
    first = next(iter(solutions.values()))
    constants = [
        f"{name} = {', '.join(f'{x:.4g}' for x in np.ravel(value))}"
        for name, value in first.unknowns.items()
    ]
    if 0 < len(constants) <= _MOST_UNKNOWNS and len(solutions) == 1:
        said.append("; ".join(constants))
    if not first.status.is_success and first.message:
        said.append(first.message)
    return "\n".join((f"{first.name}: {said[0]}", *said[1:]))
