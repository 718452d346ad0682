"""The rows of a problem: every bound and constraint that it states."""

import casadi as ca
import numpy as np

from ocp.checks.expressions import element_names
from ocp.problem.constraint_rows import ConstraintRow, ConstraintRows, ProblemRows
from ocp.problem.statement import Statement


def problem_rows(ocp: Statement) -> ProblemRows:
    """Return bounds and constraints as rows that know where they hold."""
    m, box = ocp.model, ocp.time_box
    lower, upper = float(np.asarray(box.lower)[0]), float(np.asarray(box.upper)[0])
    return ProblemRows(
        states=ConstraintRows.of_bounds(ocp.state_bounds, m.x, m.x_names, kind="hard"),
        controls=ConstraintRows.of_bounds(ocp.control_bounds, m.u, m.u_names, kind="input"),
        path=ConstraintRows.of(ocp.at("path"), "path", m),
        start=ConstraintRows.of_bounds(ocp.start_box, m.x, m.x_names, kind="hard", place="initial"),
        initial=ConstraintRows.of(ocp.at("initial"), "initial", m),
        unknowns=_unknown_rows(ocp),
        terminal=ConstraintRows.of(ocp.at("terminal"), "terminal", m),
        integral=ConstraintRows.of(ocp.at("integral"), "integral", m),
        instants=ConstraintRows.of(ocp.at("instants"), "instants", m),
        invariants=ConstraintRows.of(ocp.invariants, "path", m),
        rates=_rate_rows(ocp),
        time=ConstraintRow("final time", "time", 0, lower, upper),
    )


def _rate_rows(ocp: Statement) -> ConstraintRows:
    rates = ocp.control_rates
    symbols = ca.vertcat(ca.SX(0, 1), *[ca.SX.sym(name) for name in rates.names])
    return ConstraintRows.of_bounds(rates.box, symbols, rates.names, kind="input")


def _unknown_rows(ocp: Statement) -> ConstraintRows:
    none = ConstraintRows((), ca.SX(0, 1))
    each = [
        ConstraintRows.of_bounds(
            e.box, e.symbol, element_names(e.symbol), kind="hard", place="initial"
        )
        for e in ocp.unknowns
    ]
    return sum(each, start=none)
