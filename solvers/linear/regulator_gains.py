"""Riccati's recursion on stacked matrices, and what all linear solvers compute from arrays."""

from dataclasses import dataclass

import numpy as np

from ocp import OCP, UnsupportedProblem
from ocp.internal import LinearQuadratic, LQData, Matrices, stationary


@dataclass(frozen=True, eq=False)
class RegulatorGains:
    r"""The part of the recursion that no reference changes.

    Attributes:
        P: cost-to-go (N + 1, n, n).
        K: feedback (N, m, n).
        G: R + B'PB, (N, m, m).
        closed: A - BK, (N, n, n).
    """

    P: np.ndarray
    K: np.ndarray
    G: np.ndarray
    closed: np.ndarray


def regulator_gains(matrices: Matrices) -> RegulatorGains:
    r"""Return gains and costs-to-go, backwards from the terminal weight.

    .. math:: K_k = (R + B'P_{k+1}B)^{-1}(S' + B'P_{k+1}A), \qquad
              P_k = \begin{pmatrix} E \\ -K \end{pmatrix}'
                    \begin{pmatrix} Q & S \\ S' & R \end{pmatrix}
                    \begin{pmatrix} E \\ -K \end{pmatrix} + (A - BK)'P_{k+1}(A - BK)

    which is (2.47) and (2.48) with a cross term, as a sum of squares: no step can lose the
    symmetry or the sign of P.
    """
    a, b, w = matrices.A, matrices.B, matrices.weights
    steps, n, m = b.shape
    p, k = np.empty((steps + 1, n, n)), np.empty((steps, m, n))
    g, closed = np.empty((steps, m, m)), np.empty((steps, n, n))
    p[steps] = matrices.P
    left = np.hstack([np.eye(n), np.zeros((n, m))])
    for i in range(steps - 1, -1, -1):
        after = b[i].T @ p[i + 1]
        g[i] = matrices.R[i] + after @ b[i]
        k[i] = np.linalg.solve(g[i], matrices.S[i].T + after @ a[i])
        closed[i] = a[i] - b[i] @ k[i]
        left[:, n:] = -k[i].T
        p[i] = left @ w[i] @ left.T + closed[i].T @ p[i + 1] @ closed[i]
        p[i] = (p[i] + p[i].T) / 2
    return RegulatorGains(p, k, g, closed)


def stabilising(matrices: Matrices, name: str) -> np.ndarray:
    """Return feedback gains (N, m, n) under which errors do not grow.

    Those of the infinite horizon where they exist, else those of the recursion.
    """
    try:
        return np.repeat(stationary(matrices, name).K[None], len(matrices.A), axis=0)
    except UnsupportedProblem:
        return regulator_gains(matrices).K


def affine_parts(g: RegulatorGains, data: LQData) -> tuple[np.ndarray, np.ndarray]:
    """Return p (N + 1, n) of the cost-to-go x'Px + 2p'x, and k (N, m) of u = -Kx - k."""
    steps, m = g.K.shape[:2]
    p, ahead = np.empty((steps + 1, len(data.p))), np.empty_like(data.c)
    p[steps] = data.p
    drift = np.einsum("kij,kj->ki", g.P[1:], data.c)
    fixed = data.q - np.einsum("kji,kj->ki", g.K, data.r)
    for i in range(steps - 1, -1, -1):
        ahead[i] = drift[i] + p[i + 1]
        p[i] = fixed[i] + ahead[i] @ g.closed[i]
    h = data.r + np.einsum("kji,kj->ki", data.matrices.B, ahead)
    return p, np.linalg.solve(g.G, h[:, :, None]).reshape(steps, m)


def closed_loop_rollout(
    data: LQData, x0: np.ndarray, feedback: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return states (N + 1, n) and controls (N, m) of u = -Kx + v."""
    m = data.matrices
    x = np.empty((len(v) + 1, len(x0)))
    x[0] = x0
    closed = m.A - m.B @ feedback
    drive = np.einsum("kij,kj->ki", m.B, v) + data.c
    for i in range(len(v)):
        x[i + 1] = closed[i] @ x[i] + drive[i]
    return x, v - np.einsum("kij,kj->ki", feedback, x[:-1])


def half_slopes(data: LQData, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return half the derivatives of the running cost by states and controls, (N, n + m)."""
    z = np.hstack([x[:-1], u])
    return (data.matrices.weights @ z[:, :, None])[:, :, 0] + data.qr


def cost(data: LQData, x: np.ndarray, u: np.ndarray, half: np.ndarray) -> float:
    """Return the cost of a trajectory whose half slopes are known."""
    running = np.vdot(np.hstack([x[:-1], u]), half + data.qr)
    return float(running + x[-1] @ (data.matrices.P @ x[-1] + 2.0 * data.p) + data.constant)


def refuse_constraints(lq: LinearQuadratic, solver: str) -> None:
    """Raise ``UnsupportedProblem`` naming the first bound or constraint."""
    ocp: OCP = lq.ocp
    rows = [*lq.rows, *lq.end_rows]
    if rows:
        raise UnsupportedProblem(
            f"{ocp.name}: {solver} knows no constraints, and there is '{rows[0].name}'; "
            "take LinearMPC or MultipleShooting"
        )
