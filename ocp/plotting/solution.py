"""Figure of a solution: states, controls, costates and constraints over time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import reduce
from operator import and_
from typing import Protocol

import casadi as ca
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ocp.problem.constraint import Box
from ocp.problem.constraint_rows import ConstraintRows
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData

# Lines beyond this many take their colours from a continuous map and share a wide legend.
_FEW = 8
_LEGEND_ROWS = 12
_POINTS = 600
# Lines that vary by less are drawn with their bounds, wherever these are.
_FLAT = 1e-9


class PlottableSolution(Protocol):
    """What of a ``Solution`` is drawn: its own file, whose method this is, is built on this one."""

    @property
    def problem(self) -> OCP:
        """The problem."""
        ...

    @property
    def status(self) -> Enum:
        """How the solve ended."""
        ...

    @property
    def cost(self) -> float:
        """The solver's own."""
        ...

    @property
    def t(self) -> np.ndarray:
        """Nodes [s], (N + 1,)."""
        ...

    @property
    def u(self) -> np.ndarray:
        """Controls."""
        ...

    @property
    def control_kind(self) -> str:
        """What they are between the nodes."""
        ...

    @property
    def duration(self) -> float:
        """[s]."""
        ...

    @property
    def data(self) -> RunData:
        """The numbers of the run."""
        ...

    def state(self, t: ArrayLike) -> np.ndarray:
        """States at time(s) t [s]."""
        ...

    def control(self, t: ArrayLike) -> np.ndarray:
        """Controls at time(s) t [s]."""
        ...

    def costate_at(self, t: ArrayLike) -> np.ndarray:
        """Costates at time(s) t [s]."""
        ...

    def algebraic(self, t: ArrayLike) -> np.ndarray:
        """Algebraic variables at time(s) t [s]."""
        ...


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes: a line per column of ``values``, with bounds.

    A held quantity has one row less than there are instants.
    """

    title: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    t: np.ndarray
    values: np.ndarray
    box: Box | None = None

    @property
    def is_held(self) -> bool:
        """Whether each row holds until the next instant."""
        return len(self.values) < len(self.t)


def plot_solution(solution: PlottableSolution) -> Figure:
    """Return a figure of a solution; save it with ``figure.savefig``.

    States, controls, costates, and where the problem has them algebraic variables, path
    constraints and invariants; bounds near the lines are thin and dashed. Held quantities are
    steps, those of an extremal are smooth between its nodes.

    Args:
        solution: of any solver. What is drawn and what the title gives as its cost is its
            own; only ``evaluate`` says what its controls really do.

    Returns:
        a figure that no window and no pyplot state knows of.
    """
    panels = [panel(solution) for panel in _PANELS]
    shown = [p for p in panels if p.values.shape[1]]
    figure = Figure(figsize=(9.0, 1.0 + 2.1 * len(shown)), layout="constrained")
    axes = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for panel, ax in zip(shown, axes, strict=True):
        _draw(ax, panel)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(solution.t[0], solution.t[-1])
    figure.suptitle(
        f"{solution.problem.name}: {solution.status.name.lower().replace('_', ' ')}, "
        f"own cost {solution.cost:.6g}",
        fontsize="large",
    )
    figure.align_ylabels()
    return figure


# -- what is drawn --------------------------------------------------------------------


def _instants(solution: PlottableSolution) -> np.ndarray:
    """The nodes, and for controls that are curved between them many instants more."""
    if solution.control_kind not in ("extremal", "polynomial"):
        return solution.t
    return np.union1d(solution.t, np.linspace(solution.t[0], solution.t[-1], _POINTS))


def states(solution: PlottableSolution) -> Panel:
    """Return the states."""
    ocp, t = solution.problem, _instants(solution)
    m = ocp.model
    return Panel("states", m.x_names, m.x_units, t, solution.state(t), ocp.state_bounds)


def controls(solution: PlottableSolution) -> Panel:
    """Return the controls, with a row less where they are held."""
    ocp, t = solution.problem, _instants(solution)
    m = ocp.model
    u = solution.u if solution.control_kind == "held" else solution.control(t)
    return Panel("controls", m.u_names, m.u_units, t, u, ocp.control_bounds)


def algebraic(solution: PlottableSolution) -> Panel:
    """Return the algebraic variables."""
    m, t = solution.problem.model, _instants(solution)
    return Panel("algebraic variables", m.z_names, m.z_units, t, solution.algebraic(t))


def costates(solution: PlottableSolution) -> Panel:
    """Return the costates."""
    names = tuple(f"∂J/∂({name})" for name in solution.problem.model.x_names)
    t = _instants(solution)
    return Panel("costates", names, (), t, solution.costate_at(t))


def _path(solution: PlottableSolution) -> Panel:
    ocp, t = solution.problem, _instants(solution)
    given = [solution.state(t), solution.control(t), t[:, None], _parameters(solution, t)]
    panel = _constraints("path constraints", ocp.rows.path, ocp.functions.path, given, t)
    limits = [c.box for c in ocp.at("path")]  # also of soft ones, whose rows have none
    return replace(panel, box=reduce(and_, limits)) if limits else panel


def _invariants(solution: PlottableSolution) -> Panel:
    ocp, t = solution.problem, _instants(solution)
    given = [solution.state(t), t[:, None], _parameters(solution, t)]
    return _constraints("invariants", ocp.rows.invariants, ocp.functions.invariants, given, t)


def _parameters(solution: PlottableSolution, t: np.ndarray) -> np.ndarray:
    return solution.data.values.at((t - solution.t[0]) / solution.duration)


def _constraints(
    title: str,
    rows: ConstraintRows,
    function: ca.Function,
    given: list[np.ndarray],
    t: np.ndarray,
) -> Panel:
    values = np.array(function.map(len(t))(*[a.T for a in given])).T.reshape(len(t), len(rows))
    return Panel(title, _row_names(rows), (), t, values, rows.box)


def _row_names(rows: ConstraintRows) -> tuple[str, ...]:
    """Return the names of the constraints, numbered where one has several rows."""
    names, found = [row.name for row in rows.rows], []
    for i, name in enumerate(names):
        several = names.count(name) > 1
        found.append(f"{name} {names[:i].count(name)}" if several else name)
    return tuple(found)


_PANELS: tuple[Callable[[PlottableSolution], Panel], ...] = (
    states,
    controls,
    algebraic,
    costates,
    _path,
    _invariants,
)


# -- how it is drawn ------------------------------------------------------------------


def _draw(ax: Axes, panel: Panel) -> None:
    count = len(panel.names)
    few = count <= _FEW
    colours = colormaps["tab10"](np.arange(count))
    if not few:
        colours = colormaps["turbo"](np.linspace(0.03, 0.97, count))
    draw_lines(ax, panel, colours, _labels(panel))
    if panel.box is not None:
        _draw_bounds(ax, panel.box, panel.values, colours)
    decorate(ax, panel.title + _shared_unit(panel), count)


def draw_lines(ax: Axes, panel: Panel, colours: ArrayLike, labels: Sequence[str]) -> None:
    """Draw a line for each column of a panel."""
    for i, (label, colour) in enumerate(zip(labels, np.asarray(colours), strict=True)):
        rows = panel.values[:, i]
        if panel.is_held:
            rows = np.append(rows, rows[-1])
            ax.step(panel.t, rows, where="post", color=colour, label=label, linewidth=1.4)
        else:
            ax.plot(panel.t, rows, color=colour, label=label, linewidth=1.4)


def decorate(ax: Axes, title: str, count: int) -> None:
    """Give a panel with a number of lines its title, grid and legend."""
    ax.set_ylabel(title)
    ax.grid(alpha=0.25, linewidth=0.6)
    ax.margins(x=0.0, y=0.08)
    ax.legend(
        loc="center left",
        bbox_to_anchor=(1.005, 0.5),
        ncols=-(-count // _LEGEND_ROWS),
        frameon=False,
        fontsize="small" if count <= _FEW else 7.0,
        labelspacing=0.3,
        handlelength=1.4,
    )


def _shared_unit(panel: Panel) -> str:
    return f" [{panel.units[0]}]" if len(set(panel.units)) == 1 else ""


def _draw_bounds(ax: Axes, box: Box, values: np.ndarray, colours: np.ndarray) -> None:
    """Draw bounds that are not far from the lines: grey where shared, else in the line's colour."""
    bounds = np.vstack([np.asarray(box.lower, float), np.asarray(box.upper, float)])
    span = np.ptp(values)
    reach = 2.0 * span if span > _FLAT else np.inf
    near = (bounds > values.min() - reach) & (bounds < values.max() + reach)
    for bound in np.unique(bounds[near]):
        owners = np.flatnonzero((bounds == bound).any(axis=0))
        colour = colours[owners[0]] if len(owners) == 1 else "0.4"
        ax.axhline(bound, color=colour, linestyle=(0, (5, 4)), linewidth=0.8)


def _labels(panel: Panel) -> tuple[str, ...]:
    """The names, with their units where these differ."""
    if len(set(panel.units)) < 2:
        return panel.names
    return tuple(f"{name} [{u}]" for name, u in zip(panel.names, panel.units, strict=True))
