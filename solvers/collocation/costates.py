"""Costates of a collocated problem: the covector mapping."""

import numpy as np

from ocp.internal import RunData
from solvers.collocation.collocated_problem import CollocatedProblem
from solvers.direct.nlp_result import NlpResult


def costates(tr: CollocatedProblem, answer: NlpResult, data: RunData) -> np.ndarray:
    r"""Return dJ*/dx at all nodes, (N + 1, nx), from the multipliers of the dynamics.

    With multipliers mu_i of the points and nu of the end of an interval, the derivative of the
    Lagrangian in X_i is

    .. math::

        \mu_i + h b_i H_x(X_i, u_i, \lambda_i) + g_x' \eta_i = 0, \qquad
        \lambda_i = -\nu - \sum_j A_{ji} \mu_j / b_i

    so that lambda_i, whose multipliers are divided by the quadrature weights, obeys the costate
    equation of the continuous problem as the dual Runge-Kutta method discretises it. At an edge
    the derivative in x_k gives lambda_k = -nu - sum_j mu_j of the interval that begins, and
    lambda_K = -nu of the last. Where a path constraint or a state bound is active the costate
    jumps: an edge has the value after what is imposed there, a point the part of the jump that
    its weights give it. The final time alone has the value before what is imposed on the state
    there: a state bound that a terminal equation implies has any multiplier, and the equation the
    opposite one, so that -nu is anything [Bryson & Ho 1975, 3.11]. Source: [Hager 2000; Benson et
    al. 2006; Garg et al. 2010].

    Args:
        tr: the problem on its points.
        answer: with the multipliers, Lagrangian f + lam_g' g + lam_x' w.
        data: of the run.
    """
    nx, grid, lam_g = tr.ocp.model.nx, tr.grid, answer.lam_g
    points, intervals = len(grid.at), grid.mesh.intervals
    mu = lam_g[: nx * points].reshape(points, nx)
    nu = lam_g[nx * points : nx * (points + intervals)].reshape(intervals, nx)
    result = np.empty((len(grid.nodes), nx))
    for k, scheme in enumerate(grid.points):
        mine = grid.owner == k
        inside = -nu[k] - (scheme.A.T @ mu[mine]) / scheme.b[:, None]
        result[grid.point_nodes[mine]] = inside
        result[grid.edge_nodes[k]] = -nu[k] - mu[mine].sum(axis=0)
    result[-1] = -nu[-1] + _at_the_end(tr, answer, data)
    return result


def _at_the_end(tr: CollocatedProblem, answer: NlpResult, data: RunData) -> np.ndarray:
    """What state bounds and path constraints without control add to the costate there, (nx,).

    Gauss' points impose nothing at the end.
    """
    ocp, grid = tr.ocp, tr.grid
    if not grid.points[-1].has_end:
        return np.zeros(ocp.model.nx)
    jump = tr.split(answer.lam_x).x[:, -1]
    rows = np.array([row.place == "path" for row in tr.rows])
    count = len(ocp.rows.path.on_control)
    if not count:
        return jump
    path = answer.lam_g[rows][: count * len(grid.at)][-count:] * ~ocp.rows.path.on_control
    parts = tr.split(answer.w)
    u = parts.c[:, grid.owner == grid.mesh.intervals - 1] @ grid.points[-1].B[-1]
    at = (parts.x[:, -1], u, data.t0 + tr.duration(answer.w), data.values.at(1.0, -1)[0])
    slope = ocp.functions.path.factory("slope", ["x", "u", "t", "p"], ["jac:path:x"])
    return jump + np.array(slope(*at)).T @ path
