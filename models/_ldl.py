"""Linear equations with a symmetric positive matrix, symbolically."""

import casadi as ca


def ldl_solve(matrix: ca.SX, right: ca.SX) -> ca.SX:
    r"""Return the solution of M x = b for a symmetric positive M, by M = L D L'.

    Zeros of M stay zeros where no row before them fills them. No square root, no pivoting.

    Args:
        matrix: M (n, n), of which the lower half is read.
        right: b (n, k).
    """
    n = matrix.shape[0]
    lower = [[ca.SX(0.0)] * n for _ in range(n)]
    diagonal: list[ca.SX] = []
    rows = ca.vertsplit(right)
    for i in range(n):
        scaled = []  # L_ik D_k
        for j in range(i):
            entry = matrix[i, j] - sum((scaled[k] * lower[j][k] for k in range(j)), ca.SX(0.0))
            scaled.append(entry)
            lower[i][j] = entry / diagonal[j]
        diagonal.append(matrix[i, i] - sum((scaled[k] * lower[i][k] for k in range(i)), ca.SX(0.0)))
        rows[i] = rows[i] - sum((lower[i][k] * rows[k] for k in range(i)), ca.SX(0.0))
    rows = [row / pivot for row, pivot in zip(rows, diagonal, strict=True)]
    for i in reversed(range(n)):
        rows[i] = rows[i] - sum((lower[k][i] * rows[k] for k in range(i + 1, n)), ca.SX(0.0))
    return ca.vertcat(ca.SX(0, right.shape[1]), *rows)
