"""The functions of a problem that dynamic programming on a grid evaluates, built once."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp import OCP, Integrator
from ocp.internal import ConstraintRows, Stage
from solvers.tabular.columns import Columns


@dataclass(frozen=True, eq=False)
class GridFunctions:
    """The functions of a step, and of the last node.

    Attributes:
        step: (x, u; t, h, p0, p1) -> state and cost after it.
        path: (x, u; t, p) -> path constraints.
        last: (x; t, p) -> ``without_control`` at the last node.
        terminal: (x; t, p) -> terminal constraints.
        terminal_cost: (x; t, p) -> phi.
        without_control: path constraints that hold at the last node too.
        state_varies: whether the state after a step depends on time or on a signal.
        cost_varies: whether its cost or a path constraint does.
    """

    step: Columns
    path: Columns
    last: Columns
    terminal: Columns
    terminal_cost: Columns
    without_control: ConstraintRows
    state_varies: bool
    cost_varies: bool

    @classmethod
    def of(cls, ocp: OCP, integrator: Integrator) -> "GridFunctions":
        """Build all of them; ``integrator``: of a continuous model."""
        m, stage = ocp.model, Stage.of(ocp, integrator, held=True).step
        symbols = [ca.SX.sym(stage.name_in(i), *stage.size_in(i)) for i in range(stage.n_in())]
        after, cost = stage(*symbols)
        step = ca.Function("step", symbols, [ca.densify(ca.vertcat(after, cost))])
        rows = ocp.rows
        path, without_control = rows.path.expression, rows.path.where(~rows.path.on_control)
        _, _, t, _, p0, p1 = symbols
        signals = _signals(ocp)
        timely = ca.vertcat(t, p0[signals], p1[signals]) if signals else t
        timely_path = ca.vertcat(m.t, ocp.p[signals]) if signals else m.t
        on_path = path.numel() > 0 and ca.depends_on(path, timely_path)
        return cls(
            step=Columns(step, 2),
            path=Columns(ca.Function("path", [m.x, m.u, m.t, ocp.p], [ca.densify(path)]), 2),
            last=_at_end(ocp, "last", without_control.expression),
            terminal=_at_end(ocp, "terminal", rows.terminal.expression),
            terminal_cost=_at_end(ocp, "terminal_cost", ca.SX(ocp.terminal_cost)),
            without_control=without_control,
            state_varies=ca.depends_on(after, timely),
            cost_varies=ca.depends_on(cost, timely) or on_path,
        )


def _signals(ocp: OCP) -> list[int]:
    """Which parameters may change along the horizon."""
    moving = [e in ocp.moving for e in ocp.parameters for _ in range(e.symbol.numel())]
    return np.flatnonzero(moving).tolist()


def _at_end(ocp: OCP, name: str, column: ca.SX) -> Columns:
    m = ocp.model
    return Columns(ca.Function(name, [m.x, m.t, ocp.p], [ca.densify(column)]), 1)
