"""The regulator that never ends: algebraic Riccati equation, and a cost for what follows."""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from ocp.checks.arguments import check_instance
from ocp.checks.errors import UnsupportedProblem
from ocp.linear.linear_quadratic import Matrices
from ocp.linear.structure import linear_quadratic, read_terms
from ocp.problem.ocp import OCP

# Singular values below this, relative to the largest one, are zero.
_RANK = 1e-10


@dataclass(frozen=True, eq=False)
class Stationary:
    """The infinite-horizon regulator u = -K x with cost-to-go x'Px.

    Attributes:
        P: (n, n).
        K: (m, n).
    """

    P: np.ndarray
    K: np.ndarray


def stationary(matrices: Matrices, name: str = "the problem") -> Stationary:
    """Solve the discrete algebraic Riccati equation of the first stage.

    Source: [Anderson & Moore 1990]; solved by scipy.

    Args:
        matrices: constant from stage to stage.
        name: what messages call the problem.

    Raises:
        UnsupportedProblem: if the matrices change with time, naming the mode that the control
            does not reach, or that the cost does not see.
    """
    check_instance(matrices, Matrices, "stationary: the matrices")
    for label in ("A", "B", "Q", "S", "R"):
        if np.ptp(getattr(matrices, label), axis=0).any():
            raise UnsupportedProblem(
                f"{name}: {label} changes with time, an infinite horizon needs it constant"
            )
    a, b, q, s, r = (getattr(matrices, label)[0] for label in ("A", "B", "Q", "S", "R"))
    mode = _unreached(a, b)
    if mode is not None:
        raise UnsupportedProblem(
            f"{name}: the pair (A, B) is not stabilisable: the control does not reach "
            f"the mode with eigenvalue {mode:.6g}"
        )
    try:
        p = solve_discrete_are(a, b, q, r, s=s)
    except (LinAlgError, ValueError) as error:
        raise UnsupportedProblem(f"{name}: {_unseen(a, b, q, s, r)}") from error
    k = np.linalg.solve(r + b.T @ p @ b, s.T + b.T @ p @ a)
    if np.abs(np.linalg.eigvals(a - b @ k)).max() >= 1.0:
        raise UnsupportedProblem(f"{name}: {_unseen(a, b, q, s, r)}")
    return Stationary((p + p.T) / 2, k)


def with_stationary_end(ocp: OCP) -> OCP:
    r"""Return the problem with the cost of all that follows as its terminal cost.

    .. math:: \varphi(x) = x'Px + 2p'x, \qquad
              p = (E - A_K')^{-1} (q - K'r + A_K'Pc), \quad A_K = A - BK

    P solves the algebraic Riccati equation, and references stay where they end. Where no
    constraint is active after the horizon, a horizon of any length is then as good as an
    infinite one: the finite solution is the infinite one, cut [Mayne et al. 2000].

    Args:
        ocp: linear-quadratic in discrete time, n states; its own terminal cost is replaced.

    Raises:
        UnsupportedProblem: what ``linear_quadratic`` and ``stationary`` refuse.
    """
    check_instance(ocp, OCP, "with_stationary_end: the problem")
    lq = linear_quadratic(replace(ocp, terminal_cost=0.0))
    if lq.fixed is None:
        raise UnsupportedProblem(
            f"{ocp.name}: a matrix depends on time or parameters, an infinite horizon needs "
            "all of them constant"
        )
    regulator, first, terms = stationary(lq.fixed, ocp.name), lq.fixed, read_terms(ocp)
    closed = first.A[0] - first.B[0] @ regulator.K
    drive = terms.q - regulator.K.T @ terms.r + closed.T @ regulator.P @ terms.c
    p = np.linalg.solve(np.eye(len(closed)) - closed.T, np.eye(len(closed))) @ drive
    x = ocp.model.x
    return replace(ocp, terminal_cost=ca.bilin(regulator.P, x, x) + 2 * ca.dot(p, x))


def _unreached(a: np.ndarray, b: np.ndarray) -> complex | float | None:
    """Return an eigenvalue on or outside the unit circle that B does not reach, or None."""
    for value in np.linalg.eigvals(a):
        if abs(value) >= 1.0 - _RANK:
            singular = np.linalg.svd(np.hstack([a - value * np.eye(len(a)), b]))[1]
            if singular[len(a) - 1] <= _RANK * singular[0]:
                return complex(value) if value.imag else float(value.real)
    return None


def _unseen(a: np.ndarray, b: np.ndarray, q: np.ndarray, s: np.ndarray, r: np.ndarray) -> str:
    """Say why a stabilisable pair has no stabilising solution."""
    reduced = a - b @ np.linalg.solve(r, s.T)
    nearest = min(np.linalg.eigvals(reduced), key=lambda value: abs(abs(value) - 1.0))
    return (
        "the algebraic Riccati equation has no stabilising solution: "
        f"the cost does not see the mode on the unit circle (eigenvalue {nearest:.6g})"
    )
