"""The problem of one step of greedy control: its best input, within the constraints after it."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint
from ocp.internal import Stage

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
        rows: the constraints, of u and data; a backend that gives up returns none of its own.
        names: what each constraint says.
        lower: (rows,).
        upper: (rows,).
    """

    nlp: ca.Function
    rows: ca.Function
    names: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray

    def solve(self, u: np.ndarray, data: np.ndarray, box: Box) -> StepControl:
        """Return the best control of a step, from a first guess of it."""
        limits = {"lbx": np.asarray(box.lower), "ubx": np.asarray(box.upper)}
        answer: Any = self.nlp(x0=u, p=data, lbg=self.lower, ubg=self.upper, **limits)
        found = np.array(answer["x"]).ravel()
        g = np.array(self.rows(found, data)).ravel()
        stats = self.nlp.stats()
        ended = (
            bool(stats.get("success")),
            str(stats.get("return_status", "")),
            int(stats.get("iter_count", 0)),
        )
        if not np.isfinite(found).all() or not np.isfinite(g).all():
            return StepControl(box.clip(u), "a number that is not finite", *ended)
        excess = np.maximum(self.lower - g, g - self.upper)
        if excess.max(initial=0.0) > _VIOLATED * (1.0 + np.abs(g).max(initial=0.0)):
            worst = int(excess.argmax())
            broken = f"'{self.names[worst]}' by {excess[worst]:.3g}"
            return StepControl(box.clip(found), broken, *ended)
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
    rows = _Rows()
    path = f.path(s["x"], u, s["t"], s["p0"]), f.path(after, u, s["t_next"], s["p_next"])
    i = 0
    for c in ocp.at("path"):
        for j in range(c.size):
            here = ca.depends_on(c.expression[j], m.u)
            rows.add(c, j, path[0 if here else 1][i])
            i += 1
    for j, name in enumerate(m.x_names):
        box = ocp.state_bounds
        limits = float(np.asarray(box.lower)[j]), float(np.asarray(box.upper)[j])
        if np.isfinite(limits).any():
            rows.append(f"bound of {name}", after[j], *limits)
    if last:
        terminal, i = f.terminal(after, s["t_next"], s["p_next"]), 0
        for c in ocp.at("terminal"):
            for j in range(c.size):
                rows.add(c, j, terminal[i])
                i += 1
    data = ca.vertcat(*s.values())
    g = ca.vertcat(ca.SX(0, 1), *rows.expressions)
    nlp = ca.nlpsol("step", "ipopt", {"x": u, "f": cost, "g": g, "p": data}, options)
    function = ca.Function("rows", [u, data], [ca.densify(g)])
    return OneStep(nlp, function, tuple(rows.names), np.array(rows.lower), np.array(rows.upper))


class _Rows:
    """Constraints being collected."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.expressions: list[ca.SX] = []
        self.lower: list[float] = []
        self.upper: list[float] = []

    def add(self, c: Constraint, j: int, expression: ca.SX) -> None:
        lower, upper = np.asarray(c.lower)[j], np.asarray(c.upper)[j]
        self.append(c.name, expression, float(lower), float(upper))

    def append(self, name: str, expression: ca.SX, lower: float, upper: float) -> None:
        self.names.append(name)
        self.expressions.append(expression)
        self.lower.append(lower)
        self.upper.append(upper)
