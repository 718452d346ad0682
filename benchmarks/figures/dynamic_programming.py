"""Fig. 2.2: Bellman's recursion with one state."""

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm

from benchmarks.figures.drawing import FINITE, Drawing, label, sheet
from ocp import OCP, Box, Constraint, Model
from solvers import GridDP
from solvers.internal import ValueFunction

_GROWTH, _INPUT, _TARGET, _STEPS, _RANGE = 1.2, 1.0, 0.5, 6, 5.0
_STATE_WEIGHT = 0.05
_GRID = GridDP(states=501, controls=81)
_STARTS = (-2.5, -1.0, 1.8, 3.0)


def value_function() -> Drawing:
    """Draw value function, reachable sets and trajectories of a one-state problem."""
    program = _GRID.prepare(_problem())
    table = program.tabulate()
    runs = [program.run(x0=[x]).or_raise() for x in _STARTS]
    x, k = table.grid.axes[0].values, np.arange(_STEPS + 1)
    picture = sheet(11.0, 5.6)
    left, right = picture.subplots(1, 2)
    _field(left, table, x)
    left.plot(k, _reach(), "o--", color=FINITE, ms=4, label="reachable set, by hand")
    left.plot(k, [-r for r in _reach()], "o--", color=FINITE, ms=4)
    for i, run in enumerate(runs):
        name = {"label": "optimal trajectory"} if i == 0 else {}
        left.plot(k, run.x[:, 0], "-", marker=".", color="black", lw=1.3, **name)
    left.legend(loc="upper right", fontsize=8)
    for node in k[::-1]:
        shade = 0.15 + 0.85 * (1.0 - node / _STEPS)
        right.plot(x, table.field[node], color="tab:blue", alpha=shade, label=f"step {node}")
    label(right, "state x", "cost-to-go J", "each curve ends where its reachable set ends")
    right.set_xlim(*left.get_ylim())
    right.legend(fontsize=8, loc="upper center")
    found = x[table.reachable[0]].max()
    sentence = (
        f"Fig. 2.2: the set from which |x_N| <= {_TARGET:g} can be reached grows backwards from "
        f"|x| <= {x[table.reachable[-1]].max():.2f} to |x| <= {found:.2f} in {_STEPS} steps (by "
        f"hand {_reach()[0]:.3f}); outside it the value function is infinite, within it convex, "
        f"J_0(3) = {runs[-1].history['value'][-1]:.2f}, error estimate {runs[-1].residual:.2g}. "
        f"Chosen here: x+ = {_GROWTH:g} x + u, |u| <= {_INPUT:g}, "
        f"cost {_STATE_WEIGHT:g} x^2 + u^2, {len(x)} states, 81 inputs."
    )
    return Drawing(picture, _columns(table, x), sentence)


def _problem() -> OCP:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return OCP(
        name="one state",
        model=Model(name="one state", x=x, u=u, f=_GROWTH * x + u, dt=1.0),
        x0=_STARTS[-1],
        horizon=_STEPS,
        running_cost=_STATE_WEIGHT * x**2 + u**2,
        state_bounds=Box(-_RANGE, _RANGE),
        control_bounds=Box(-_INPUT, _INPUT),
        constraints=(Constraint("target", x, -_TARGET, _TARGET, at="terminal"),),
    )


def _reach() -> list[float]:
    """Half widths of the reachable sets: r_k = (r_{k+1} + u) / growth."""
    widths = [_TARGET]
    for _ in range(_STEPS):
        widths.insert(0, (widths[0] + _INPUT) / _GROWTH)
    return widths


def _field(axes: Axes, table: ValueFunction, x: np.ndarray) -> None:
    values = np.where(table.reachable, table.field, np.nan).T
    edges = np.arange(_STEPS + 2) - 0.5
    half = 0.5 * (x[1] - x[0])
    sides = np.append(x - half, x[-1] + half)
    shown = axes.pcolormesh(edges, sides, values, cmap="viridis", norm=PowerNorm(0.5, vmin=0.0))
    assert axes.figure is not None
    axes.figure.colorbar(shown, ax=axes)
    axes.set_ylim(-4.2, 5.2)
    label(axes, "step k", "state x", "cost-to-go J by colour (white: no way to the target)")


def _columns(table: ValueFunction, x: np.ndarray) -> dict[str, np.ndarray]:
    columns = {"x [-]": x}
    for k in range(_STEPS + 1):
        columns[f"J_{k} [-]"] = table.field[k]
    for k in range(_STEPS):
        usable = table.reachable[k]
        columns[f"u_{k} [-]"] = np.where(usable, table.policy[k][:, 0], np.nan)
    return columns
