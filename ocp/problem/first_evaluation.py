"""What of a problem is not finite where it starts."""

from functools import cached_property
from typing import Protocol

import casadi as ca
import numpy as np

from ocp.checks.expressions import readable
from ocp.problem.called_functions import undefined_call
from ocp.problem.constraint import Box, Constraint
from ocp.problem.functions import Functions
from ocp.problem.model import Model


class _Problem(Protocol):
    """What is evaluated of an ``OCP``."""

    @property
    def model(self) -> Model:
        """The dynamics."""
        ...

    @property
    def running_cost(self) -> ca.SX | float:
        """The cost per time."""
        ...

    @property
    def terminal_cost(self) -> ca.SX | float:
        """The cost at the end."""
        ...

    @property
    def p(self) -> ca.SX:
        """Symbols of all that a run gives."""
        ...

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """Of all places."""
        ...

    @cached_property
    def functions(self) -> Functions:
        """The same as Functions."""
        ...


def inside(box: Box) -> np.ndarray:
    """Return controls within their bounds, not on them: the middle, 1 off a single bound, or 0."""
    lower, upper = np.asarray(box.lower, dtype=float), np.asarray(box.upper, dtype=float)
    is_below, is_above = np.isfinite(lower), np.isfinite(upper)
    below, above = np.where(is_below, lower, 0.0), np.where(is_above, upper, 0.0)
    one_sided = np.where(is_below, np.maximum(below + 1.0, 0.0), np.minimum(above - 1.0, 0.0))
    one_sided = np.where(is_below | is_above, one_sided, 0.0)
    return np.where(is_below & is_above, (below + above) / 2.0, one_sided)


def fault_at(ocp: _Problem, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> str:
    """Return which expression is not finite at t = 0, in words; "" if all are.

    Args:
        ocp: the problem.
        x: start (nx,).
        u: controls (nu,).
        p: parameters (n_p,).
    """
    m, functions = ocp.model, ocp.functions
    symbols, path = ca.vertcat(m.x, m.u, m.t, ocp.p), [c for c in ocp.constraints if c.at == "path"]
    constraints = ca.vertcat(ca.SX(0, 1), *[c.expression for c in path])
    for what, expression, value in (
        ("dynamics f", ocp.model.f, functions.rate(x, u, 0.0, p)),
        ("running_cost", ocp.running_cost, functions.running_cost(x, u, 0.0, p)),
        ("terminal_cost", ocp.terminal_cost, functions.terminal_cost(x, 0.0, p)),
        ("constraints", constraints, functions.path(x, u, 0.0, p)),
    ):
        rows = np.flatnonzero(~np.isfinite(np.asarray(value, dtype=float).ravel()))
        if rows.size:
            row = ca.vertsplit(ca.densify(ca.SX(expression)))[int(rows[0])]
            fault = f"{what} (row {rows[0]}) is not finite at x0 = {x}, u = {u}: {readable(row)}"
            lost = undefined_call(row, symbols, np.concatenate([x, u, [0.0], p])[None, :])
            return f"{fault}; {lost.said}" if lost else fault
    return ""
