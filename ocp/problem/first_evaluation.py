"""What of a problem is not finite where it starts."""

import casadi as ca
import numpy as np

from ocp.checks.expressions import readable
from ocp.problem.called_functions import undefined_call
from ocp.problem.functions import Functions
from ocp.problem.statement import Statement


def fault_at(
    ocp: Statement, functions: Functions, x: np.ndarray, u: np.ndarray, p: np.ndarray
) -> str:
    """Return which expression is not finite at t = 0, in words; "" if all are.

    Args:
        ocp: the problem, without algebraic variables.
        functions: of it.
        x: start (nx,).
        u: controls (nu,).
        p: parameters (n_p,).
    """
    m = ocp.model
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
