"""One stage of the Riccati recursion of a Newton step: backwards, forwards, and as a feedback.

``backwards``: value function and feedback law; ``forwards``: the linear model under that law;
``feedback_rollout``: the model itself under that law.
"""

import casadi as ca

from ocp import Box

# A diagonal of zero has a relative pivot of zero, not of 0 / 0.
_TINY = 1e-300


def backwards(nx: int, nu: int) -> ca.Function:
    r"""Return the value function of a stage from that of the next one.

    It is v'dx + dx'P dx / 2, kept as (P, v). With the Jacobian (A, B) of the step, its defect c,
    the Lagrangian's gradient (q, r) and second derivative H in (x, u), and a shift sigma,

    .. math::
        Q_{uu} = H_{uu} + \sigma E + B'PB, \quad Q_{ux} = H_{ux} + B'PA, \quad
        Q_u = r + B'(v + Pc), \quad du = K dx + \kappa.

    The step of some controls b, the clamped ones, is given: there K = 0 and kappa is that step.
    The free ones f minimise the value, and leave a gradient g in the clamped ones:

    .. math::
        (K, \kappa)_f = -Q_{ff}^{-1} (Q_{fx}, \; Q_f + Q_{fb} \kappa_b), \quad
        g = Q_u + Q_{ux} dx + Q_{uu} du,

    .. math::
        P \leftarrow H_{xx} + A'PA + Q_{ux}'K, \quad
        v \leftarrow q + A'(v + Pc) + Q_{ux}'\kappa.

    since K'(Q_ux + Q_uu K) and K'(Q_u + Q_uu kappa) vanish, row by row.
    Source: [Dunn & Bertsekas 1989]; thesis (2.24) for the linear case.

    Returns:
        the function of ((P, v) of the next stage (nx, nx + 1), H, (A, B), (q, r), c, sigma,
        clamped (nu,) as 0 or 1, clamped step (nu,) or 0) that returns (P, v) of the stage; as
        functions of (dx, 1) the law (nu + nx, nx + 1) with the rows of (du, dp = P dx + v), and
        its effect, the rows of (dx after, g); and the pivots of Q_ff over its diagonal (nu,), 1
        for a clamped control: all are positive if and only if Q_ff is positive definite.
    """
    nw = nx + nu
    value, hessian = ca.SX.sym("value", nx, nx + 1), ca.SX.sym("hessian", nw, nw)
    jacobian, gradient = ca.SX.sym("jacobian", nx, nw), ca.SX.sym("gradient", nw)
    defect, sigma = ca.SX.sym("defect", nx), ca.SX.sym("sigma")
    clamped, clamped_step = ca.SX.sym("clamped", nu), ca.SX.sym("clamped_step", nu)
    curved, linear = value[:, :nx], value[:, nx]
    both = hessian + jacobian.T @ (curved @ jacobian)
    ahead = gradient + jacobian.T @ (linear + curved @ defect)
    q_uu, q_ux = both[nx:, nx:] + sigma * ca.SX.eye(nu), both[nx:, :nx]
    q = ca.horzcat(q_ux, ahead[nx:])
    given = ca.horzcat(ca.SX.zeros(nu, nx), clamped_step)
    free = ca.diag(1 - clamped)
    q_ff = free @ q_uu @ free + ca.diag(clamped)
    gains, pivots = _solved(q_ff, given - free @ (q + q_uu @ given))
    before = ca.horzcat(both[:nx, :nx], ahead[:nx]) + q_ux.T @ gains
    before[:, :nx] = (before[:, :nx] + before[:, :nx].T) / 2  # else rounding errors grow
    after = ca.horzcat(jacobian[:, :nx], defect) + jacobian[:, nx:] @ gains
    left = ca.diag(clamped) @ (q + q_uu @ gains)
    inputs = [value, hessian, jacobian, gradient, defect, sigma, clamped, clamped_step]
    outputs = [before, ca.vertcat(gains, before), ca.vertcat(after, left), pivots]
    return ca.Function("backwards", inputs, ca.cse([ca.densify(o) for o in outputs]))


def forwards(nx: int, nu: int) -> ca.Function:
    """Return the linear model under the law: (dx, law, effect) -> (dx after, du, dp, g)."""
    nw, dx = nx + nu, ca.SX.sym("dx", nx)
    law, effect = ca.SX.sym("law", nw, nx + 1), ca.SX.sym("effect", nw, nx + 1)
    du, dcostate = ca.vertsplit(law @ ca.vertcat(dx, 1), [0, nu, nw])
    after, left = ca.vertsplit(effect @ ca.vertcat(dx, 1), [0, nx, nw])
    return ca.Function("forwards", [dx, law, effect], [after, du, dcostate, left])


def feedback_rollout(step: ca.Function, bounds: Box) -> ca.Function:
    r"""Return one stage of the model itself under the law.

    With the step length s, from a state y where the iterate has x, u, p,

    .. math:: \hat u = u + K (y - x) + s \kappa, \quad \hat p = p + P (y - x) + s v, \quad
              \hat y = F(y, \hat u) - (1 - s) c

    so that defects shrink as in the linear model, and a full step closes them. Controls are
    clipped to their bounds: where u and u + du lie within them, only K times the curvature of the
    model can leave them, which is of second order in s.
    Source: [Giftthaler et al. 2018].

    Returns:
        the function of (y, s, law, c, x, u, p, t, h, p0, p1) to y after, u and p.
    """
    nx, nu = step.size1_in(0), step.size1_in(1)
    y, length, defect = ca.SX.sym("y", nx), ca.SX.sym("length"), ca.SX.sym("defect", nx)
    law = ca.SX.sym("law", nu + nx, nx + 1)
    x, u, costate = ca.SX.sym("x", nx), ca.SX.sym("u", nu), ca.SX.sym("costate", nx)
    changes = law @ ca.vertcat(y - x, length)
    control: ca.SX = bounds.clip_expression(u + changes[:nu])
    rest: list = [ca.SX.sym(step.name_in(i), step.size_in(i)) for i in range(2, 6)]
    after, _ = step.call([y, control, *rest])
    inputs = [y, length, law, defect, x, u, costate, *rest]
    outputs = [after - (1 - length) * defect, control, costate + changes[nu:]]
    return ca.Function("follow", inputs, ca.cse([ca.densify(o) for o in outputs]))


def _solved(matrix: ca.SX, right: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return matrix^-1 right for a symmetric matrix, and its relative pivots.

    Elimination without exchange of rows, which a positive definite matrix does not need. Where a
    pivot is not positive the matrix is not positive definite, and the solution is not to be used.
    """
    size = matrix.shape[0]
    work = ca.horzcat(matrix, right)
    for i in range(size):
        for j in range(i + 1, size):
            # By symmetry the factor of row j is in row i: column j below i is not computed.
            work[j, j:] -= work[i, j] / work[i, i] * work[i, j:]
    solution = [ca.SX(0)] * size
    for i in reversed(range(size)):
        known = sum((work[i, j] * solution[j] for j in range(i + 1, size)), ca.SX(0))
        solution[i] = (work[i, size:] - known) / work[i, i]
    pivots = ca.diag(work[:, :size]) / (ca.fabs(ca.diag(matrix)) + _TINY)
    return ca.vertcat(*solution), pivots
