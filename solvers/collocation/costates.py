"""Costates of a collocated problem: the covector mapping."""

import numpy as np

from solvers.collocation.transcription import Collocated


def costates(tr: Collocated, lam_g: np.ndarray) -> np.ndarray:
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
    its weights give it. Source: [Hager 2000; Benson et al. 2006; Garg et al. 2010].

    Args:
        tr: the problem on its points.
        lam_g: multipliers of all rows, Lagrangian f + lam_g' g.
    """
    nx, grid = tr.ocp.model.nx, tr.grid
    points, intervals = len(grid.at), grid.mesh.intervals
    mu = lam_g[: nx * points].reshape(points, nx)
    nu = lam_g[nx * points : nx * (points + intervals)].reshape(intervals, nx)
    result = np.empty((len(grid.nodes), nx))
    for k, scheme in enumerate(grid.points):
        mine = grid.owner == k
        inside = -nu[k] - (scheme.A.T @ mu[mine]) / scheme.b[:, None]
        result[grid.point_nodes[mine]] = inside
        result[grid.edge_nodes[k]] = -nu[k] - mu[mine].sum(axis=0)
    result[-1] = -nu[-1]
    return result
