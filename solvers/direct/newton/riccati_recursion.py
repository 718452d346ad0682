"""One stage of the Riccati recursion of a Newton step: backwards, and forwards again."""

import casadi as ca
import numpy as np

from ocp import Box

# A diagonal of zero has a relative pivot of zero, not of 0 / 0.
_TINY = 1e-300


def backwards(nx: int, nu: int) -> ca.Function:
    r"""Return the value of a stage from that of the next one.

    The value is v'dx + dx'P dx / 2, kept as (P, v). With the derivatives (A, B) of the step, its
    gap c, the Lagrangian's slope (q, r) and second derivative H in (x, u), and a shift sigma,

    .. math::
        Q_{uu} = H_{uu} + \sigma E + B'PB, \quad Q_{ux} = H_{ux} + B'PA, \quad
        Q_u = r + B'(v + Pc), \quad du = K dx + \kappa.

    Some controls b, the clamped ones, are told their move: there K = 0 and kappa is the move. The
    free ones f minimise what is left, and leave the clamped ones a slope g:

    .. math::
        (K, \kappa)_f = -Q_{ff}^{-1} (Q_{fx}, \; Q_f + Q_{fb} \kappa_b), \quad
        g = Q_u + Q_{ux} dx + Q_{uu} du,

    .. math::
        P \leftarrow H_{xx} + A'PA + Q_{ux}'K, \quad
        v \leftarrow q + A'(v + Pc) + Q_{ux}'\kappa.

    since K'(Q_ux + Q_uu K) and K'(Q_u + Q_uu kappa) vanish, row by row.
    Source: [Dunn & Bertsekas 1989]; thesis (2.24) for the linear case.

    Returns:
        a function of ((P, v) (nx, nx + 1), H, (A, B), (q, r), c, sigma, whether a control is
        clamped as 0 or 1 (nu,), its move (nu,) or 0) that returns the value before; as functions
        of (dx, 1) the law (nu + nx, nx + 1) with the rows of (du, dp = P dx + v), and what it
        leads to, (dx after, g); and the pivots of Q_ff over its diagonal (nu,), 1 for a clamped
        control: all are positive if and only if it is positive definite.
    """
    nw = nx + nu
    value, hessian = ca.SX.sym("value", nx, nx + 1), ca.SX.sym("hessian", nw, nw)
    jacobian, slope = ca.SX.sym("jacobian", nx, nw), ca.SX.sym("slope", nw)
    gap, sigma = ca.SX.sym("gap", nx), ca.SX.sym("sigma")
    clamped, move = ca.SX.sym("clamped", nu), ca.SX.sym("move", nu)
    curved, linear = value[:, :nx], value[:, nx]
    both = hessian + jacobian.T @ (curved @ jacobian)
    ahead = slope + jacobian.T @ (linear + curved @ gap)
    q_uu, q_ux = both[nx:, nx:] + sigma * ca.SX.eye(nu), both[nx:, :nx]
    q = ca.horzcat(q_ux, ahead[nx:])
    told = ca.horzcat(ca.SX.zeros(nu, nx), move)
    free = ca.diag(1 - clamped)
    q_ff = free @ q_uu @ free + ca.diag(clamped)
    gains, pivots = _solved(q_ff, told - free @ (q + q_uu @ told))
    before = ca.horzcat(both[:nx, :nx], ahead[:nx]) + q_ux.T @ gains
    before[:, :nx] = (before[:, :nx] + before[:, :nx].T) / 2  # else rounding grows
    after = ca.horzcat(jacobian[:, :nx], gap) + jacobian[:, nx:] @ gains
    left = ca.diag(clamped) @ (q + q_uu @ gains)
    inputs = [value, hessian, jacobian, slope, gap, sigma, clamped, move]
    outputs = [before, ca.vertcat(gains, before), ca.vertcat(after, left), pivots]
    return ca.Function("backwards", inputs, ca.cse([ca.densify(o) for o in outputs]))


def forwards(nx: int, nu: int) -> ca.Function:
    """Return what the law says of the linear model: (dx, law, effect) -> (dx after, du, dp, g)."""
    nw, dx = nx + nu, ca.SX.sym("dx", nx)
    law, effect = ca.SX.sym("law", nw, nx + 1), ca.SX.sym("effect", nw, nx + 1)
    du, dcostate = ca.vertsplit(law @ ca.vertcat(dx, 1), [0, nu, nw])
    after, left = ca.vertsplit(effect @ ca.vertcat(dx, 1), [0, nx, nw])
    return ca.Function("forwards", [dx, law, effect], [after, du, dcostate, left])


def feedback_rollout(step: ca.Function, bounds: Box) -> ca.Function:
    r"""Return what the law makes of the model itself.

    With a share s of the step, from a state y where the iterate has x, u, p,

    .. math:: \hat u = u + K (y - x) + s \kappa, \quad \hat p = p + P (y - x) + s v, \quad
              \hat y = F(y, \hat u) - (1 - s) c

    so that gaps shrink as the linear model says, and a full step closes them. Controls are
    clipped to their bounds: where u and u + du lie within, K times the curvature of the model
    leads out of them, which is of second order in s.
    Source: [Giftthaler et al. 2018].

    Returns:
        a function of (y, share, law, c, x, u, p, t, h, p0, p1) that returns y after, u and p.
    """
    nx, nu = step.size1_in(0), step.size1_in(1)
    y, share, gap = ca.SX.sym("y", nx), ca.SX.sym("share"), ca.SX.sym("gap", nx)
    law = ca.SX.sym("law", nu + nx, nx + 1)
    x, u, costate = ca.SX.sym("x", nx), ca.SX.sym("u", nu), ca.SX.sym("costate", nx)
    moves = law @ ca.vertcat(y - x, share)
    control: ca.SX = bounds.clip_expression(u + moves[:nu])
    rest: list = [ca.SX.sym(step.name_in(i), step.size_in(i)) for i in range(2, 6)]
    after, _ = step.call([y, control, *rest])
    inputs = [y, share, law, gap, x, u, costate, *rest]
    outputs = [after - (1 - share) * gap, control, costate + moves[nu:]]
    return ca.Function("follow", inputs, ca.cse([ca.densify(o) for o in outputs]))


def _solved(matrix: ca.SX, right: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return matrix^-1 right for a symmetric matrix, and its relative pivots.

    Elimination without exchange of rows, which needs no more where the matrix is positive
    definite; where it is not the pivots say so, and the solution means nothing.
    """
    size = matrix.shape[0]
    work = ca.horzcat(matrix, right)
    for i in range(size):
        for j in range(i + 1, size):
            # By symmetry the factor of row j stands in row i, which is spared its own column j.
            work[j, j:] -= work[i, j] / work[i, i] * work[i, j:]
    solution = [ca.SX(0)] * size
    for i in reversed(range(size)):
        known = sum((work[i, j] * solution[j] for j in range(i + 1, size)), ca.SX(0))
        solution[i] = (work[i, size:] - known) / work[i, i]
    pivots = ca.diag(work[:, :size]) / (ca.fabs(ca.diag(matrix)) + _TINY)
    return ca.vertcat(*solution), pivots


def units(bounds: Box) -> np.ndarray:
    """Return in what each control is measured: the width of its bounds, at most and else one.

    A slope times its unit is what a control can make of it. Wide bounds often stand for none, so
    that their width says nothing; bounds that are equal have none.
    """
    width = np.asarray(bounds.upper) - np.asarray(bounds.lower)
    return np.where(width > 0.0, np.minimum(width, 1.0), 1.0)
