"""Which constraint cannot be met: the point that violates the rows least."""

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog

from solvers.linear.qp.quadratic_program import QP


def least_violation(qp: QP, elastic: np.ndarray, rows: int) -> tuple[np.ndarray, np.ndarray]:
    r"""Minimise the sum of the excesses of some rows, the others being hard.

    .. math:: \min \sum e_i \quad \text{s.t.} \quad l - e \le Gz \le u + e, \; e \ge 0

    A linear program, whatever backend the quadratic one has; solved by HiGHS, through scipy.

    Args:
        qp: the program; its cost does not count.
        elastic: indices of the rows that are relaxed.
        rows: number of rows to report on.

    Returns:
        a point (n,) and the excess of each row (rows,), zero where all can be met. If
        even the hard rows contradict each other, all rows are relaxed.
    """
    for relaxed in (elastic, np.flatnonzero(qp.l != qp.u), np.arange(len(qp.l))):
        point, excess = _solve(qp, relaxed)
        if point is not None:
            return point, excess[:rows]
    return np.zeros(len(qp.g)), np.zeros(rows)


def _solve(qp: QP, relaxed: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    n, count = len(qp.g), len(relaxed)
    # Every row with its excess: upper rows G z - e <= u, lower rows -G z - e <= -l.
    select = sp.csr_matrix((np.ones(count), (relaxed, np.arange(count))), shape=(len(qp.l), count))
    equal = qp.l == qp.u
    equal[relaxed] = False
    above, below = np.isfinite(qp.u) & ~equal, np.isfinite(qp.l) & ~equal
    g = qp.G.tocsr()
    upper = sp.vstack(
        [
            sp.hstack([g[above], -select[above]]),
            sp.hstack([-g[below], -select[below]]),
        ]
    )
    fixed = sp.hstack([g[equal], sp.csr_matrix((int(equal.sum()), count))])
    found = linprog(
        np.concatenate([np.zeros(n), np.ones(count)]),
        A_ub=upper,
        b_ub=np.concatenate([qp.u[above], -qp.l[below]]),
        A_eq=fixed,
        b_eq=qp.u[equal],
        bounds=[(None, None)] * n + [(0.0, None)] * count,
        method="highs",
    )
    excess = np.zeros(len(qp.l))
    if found.x is None:
        return None, excess
    excess[relaxed] = found.x[n:]
    return found.x[:n], excess
