"""Is this problem linear-quadratic? Its matrices, or the term that is not."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks.arguments import check_instance
from ocp.checks.errors import UnsupportedProblem
from ocp.linear.linear_quadratic import LinearQuadratic
from ocp.linear.polynomial import beyond
from ocp.problem.constraint_rows import ConstraintRows
from ocp.problem.ocp import OCP
from ocp.problem.refusal import refuse_free_start


@dataclass(frozen=True, eq=False)
class Terms:
    """Symbolic coefficients of a problem, free of x and u: functions of t and parameters.

    Dynamics A x + B u + c; running cost x'Qx + 2x'Su + u'Ru + 2q'x + 2r'u + constant.
    """

    A: ca.SX
    B: ca.SX
    c: ca.SX
    Q: ca.SX
    S: ca.SX
    R: ca.SX
    q: ca.SX
    r: ca.SX
    constant: ca.SX


def linear_quadratic(ocp: OCP) -> LinearQuadratic:
    """Read the matrices of a discrete-time linear-quadratic problem off its expressions.

    Source: thesis (2.1) to (2.3), (2.14), (2.82).

    Args:
        ocp: the problem; its constraints are read as well.

    Raises:
        UnsupportedProblem: naming the term that is not linear or quadratic, or the weight that
            is indefinite with its eigenvalue; for a continuous model, which ``discretise``
            makes discrete; for a start on a manifold, and a ``Rate``.
    """
    check_instance(ocp, OCP, "linear_quadratic: the problem")
    if not ocp.model.is_discrete:
        raise UnsupportedProblem(
            f"{ocp.name}: the model is continuous in time; make it discrete: discretise(ocp, dt)"
        )
    if not ocp.model.nu:
        raise UnsupportedProblem(f"{ocp.name}: the linear solvers need a control, there is none")
    refuse_free_start(ocp, "a linear solver")
    for delay in ocp.delays:
        raise UnsupportedProblem(
            f"{ocp.name}: the Delay of '{delay.control}' is no part of A and B: LinearMPC and "
            "Riccati take it by themselves; to read matrices, write what was sent as states"
        )
    for peak in ocp.peaks:
        raise UnsupportedProblem(f"{ocp.name}: the peak of '{peak.name}' is not quadratic")
    for name in ocp.control_rates.names:
        raise UnsupportedProblem(
            f"{ocp.name}: the {name} is no part of A, B, Q, R: LinearMPC and Riccati take it by "
            "themselves; to read matrices, write the last input as a state"
        )
    for what, parts in (
        ("the measurements", ocp.data),
        ("the unknown constants", ocp.unknowns),
        ("the constraints at instants", ocp.at("instants")),
        ("the integral constraints", ocp.at("integral")),
    ):
        if parts:
            raise UnsupportedProblem(f"{ocp.name}: {what} are no part of A, B, Q, R")
    ocp = ocp.explicit
    lq = _assemble(ocp, read_terms(ocp))
    complaint = lq.sample_matrices(lq.declared).indefinite()
    if complaint:
        raise UnsupportedProblem(f"{ocp.name}: {complaint}")
    return lq


def read_terms(ocp: OCP) -> Terms:
    """Return the coefficients of dynamics and running cost, symbolically.

    Raises:
        UnsupportedProblem: naming the term that is not linear or not quadratic.
    """
    m = ocp.model
    require_degree(ocp, m.f, 1, "the dynamics f")
    require_degree(ocp, ca.SX(ocp.running_cost), 2, "running_cost")
    require_degree(ocp, ca.SX(ocp.terminal_cost), 2, "terminal_cost")
    hessian, slope, constant = _quadratic(ca.SX(ocp.running_cost), ca.vertcat(m.x, m.u))
    n, (a_b, c) = m.nx, _affine(m.f, ca.vertcat(m.x, m.u))
    return Terms(
        A=a_b[:, :n],
        B=a_b[:, n:],
        c=c,
        Q=hessian[:n, :n] / 2,
        S=hessian[:n, n:] / 2,
        R=hessian[n:, n:] / 2,
        q=slope[:n] / 2,
        r=slope[n:] / 2,
        constant=constant,
    )


def require_degree(ocp: OCP, expression: ca.SX, degree: int, what: str) -> None:
    """Raise ``UnsupportedProblem`` with the offending term where a degree is exceeded."""
    rows = ca.vertsplit(expression) if expression.numel() else []
    for i, row in enumerate(rows):
        term = beyond(row, ocp.model.x, ocp.model.u, degree)
        if term:
            which = f"{what}[{i}]" if len(rows) > 1 else what
            kind = "linear" if degree == 1 else "quadratic"
            raise UnsupportedProblem(f"{ocp.name}: {which} is not {kind} in {term}")


def _affine(expression: ca.SX, v: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return slope and value at zero of a linear column."""
    zero = ca.DM.zeros(v.numel())
    slope = ca.densify(ca.jacobian(expression, v))
    return ca.substitute(slope, v, zero), ca.substitute(expression, v, zero)


def _quadratic(expression: ca.SX, v: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return Hessian, slope at zero and value at zero of a quadratic scalar."""
    zero = ca.DM.zeros(v.numel())
    hessian, gradient = ca.hessian(expression, v)
    at_zero = [ca.densify(ca.substitute(e, v, zero)) for e in (hessian, gradient, expression)]
    return at_zero[0], at_zero[1], at_zero[2]


def _assemble(ocp: OCP, terms: Terms) -> LinearQuadratic:
    m, s = ocp.model, terms
    inputs, v = [m.t, ocp.p], ca.vertcat(m.x, m.u)
    for c in ocp.constraints:
        require_degree(ocp, c.expression, 1, f"{c.at} constraint '{c.name}'")
    path = ocp.rows.path + _bounded(ocp.rows.states)
    rows = path + _bounded(ocp.rows.controls)
    end = path.where(~path.on_control) + ocp.rows.terminal
    d, d_0 = _affine(rows.expression, v)
    d_f, d_f0 = _affine(end.expression, m.x)
    hessian, slope, constant = _quadratic(ca.SX(ocp.terminal_cost), m.x)
    blocks = [s.A, s.B, s.Q, s.S, s.R, d[:, : m.nx], d[:, m.nx :]]
    vectors = ca.vertcat(s.c, s.q, s.r, s.constant, d_0)
    end_vectors = ca.vertcat(slope / 2, constant, d_f0)
    return LinearQuadratic(
        ocp=ocp,
        rows=rows.rows,
        end_rows=end.rows,
        on_control=rows.on_control,
        stage_matrices=ca.Function("stage_matrices", inputs, [ca.densify(b) for b in blocks]),
        stage_vectors=ca.Function("stage_vectors", inputs, [ca.densify(vectors)]),
        end_matrices=ca.Function("end_matrices", inputs, [hessian / 2, ca.densify(d_f)]),
        end_vectors=ca.Function("end_vectors", inputs, [ca.densify(end_vectors)]),
        row_box=rows.box,
        end_box=end.box,
    )


def _bounded(rows: ConstraintRows) -> ConstraintRows:
    """Return the rows that have a bound."""
    return rows.where(np.isfinite(rows.box.lower) | np.isfinite(rows.box.upper))
