"""The problem of one step of greedy control: its best input, within the constraints after it."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ocp import OCP, Box
from ocp.internal import BufferedNlp, ConstraintRows, Stage

# Beyond this a constraint counts as violated, whatever the backend says.
_VIOLATED = 1e-6


class StepControl(NamedTuple):
    """The control of one step.

    Attributes:
        u: control (nu,), within its bounds.
        broken: which constraint it breaks, and by how much; empty if none.
        success: whether the backend says so.
        word: how the backend says that it ended.
        iterations: of the backend.
    """

    u: np.ndarray
    broken: str
    success: bool
    word: str
    iterations: int


@dataclass(frozen=True, eq=False)
class OneStep:
    """The problem of one step.

    Attributes:
        nlp: unknown u; data x, t, h, p0, p1, and t and p after the step.
        values: of the constraints, of u and data; a backend that gives up returns none of its own.
        rows: what each constraint is.
    """

    nlp: BufferedNlp
    values: ca.Function
    rows: ConstraintRows

    def solve(self, u: np.ndarray, data: np.ndarray, box: Box) -> StepControl:
        """Return the best control of a step, from a first guess of it."""
        limits = {"lbx": box.lower, "ubx": box.upper}
        rows = self.rows.box
        limits |= {"lbg": rows.lower, "ubg": rows.upper}
        answer, stats = self.nlp({"x0": u, "p": data, **limits})
        found = answer["x"]
        g = np.array(self.values(found, data)).ravel()
        ended = (
            bool(stats.get("success")),
            str(stats.get("return_status", "")),
            int(stats.get("iter_count", 0)),
        )
        if not np.isfinite(found).all() or not np.isfinite(g).all():
            return StepControl(box.clip(u), "a number that is not finite", *ended)
        worst = self.rows.largest_violation(g[None, :], np.zeros(1))
        if worst.amount > _VIOLATED * (1.0 + np.abs(g).max(initial=0.0)):
            return StepControl(box.clip(found), f"{worst.row} by {worst.amount:.3g}", *ended)
        return StepControl(box.clip(found), "", *ended)


def one_step(ocp: OCP, stage: Stage, options: dict[str, Any], *, last: bool) -> OneStep:
    """Build the problem of every step but the last, or that of the last."""
    m, n_p, f = ocp.model, ocp.p.numel(), ocp.functions
    sizes = {"x": m.nx, "t": 1, "h": 1, "p0": n_p, "p1": n_p, "t_next": 1, "p_next": n_p}
    s = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
    u = ca.SX.sym("u", m.nu)
    after, _ = stage.step(s["x"], u, s["t"], s["h"], s["p0"], s["p1"])
    if m.is_discrete and last:
        cost = f.running_cost(s["x"], u, s["t"], s["p0"])
    else:
        end = s["p_next"] if m.is_discrete else s["p1"]
        weight = 1.0 if m.is_discrete else s["h"]
        cost = weight * f.running_cost(after, u, s["t_next"], end)
    if last:
        cost += f.terminal_cost(after, s["t_next"], s["p_next"])
    rows = _rows(ocp, last=last)
    path = f.path(s["x"], u, s["t"], s["p0"]), f.path(after, u, s["t_next"], s["p_next"])
    imposed = [path[0 if row.on_control else 1][i] for i, row in enumerate(ocp.rows.path.rows)]
    imposed += [after[j] for j in np.flatnonzero(_bounded(ocp)).tolist()]
    if last:
        imposed.append(f.terminal(after, s["t_next"], s["p_next"]))
    data = ca.vertcat(*s.values())
    g = ca.vertcat(ca.SX(0, 1), *imposed)
    nlp = ca.nlpsol("step", "ipopt", {"x": u, "f": cost, "g": g, "p": data}, options)
    function = ca.Function("rows", [u, data], [ca.densify(g)])
    return OneStep(BufferedNlp(nlp), function, rows)


def _rows(ocp: OCP, *, last: bool) -> ConstraintRows:
    """Return what a step imposes: path constraints, bounds of the next state, and the end."""
    rows = ocp.rows.path + ocp.rows.states.where(_bounded(ocp))
    return rows + ocp.rows.terminal if last else rows


def _bounded(ocp: OCP) -> np.ndarray:
    """Return which states have a bound, bool (nx,)."""
    box = ocp.state_bounds
    return np.isfinite(box.lower) | np.isfinite(box.upper)
