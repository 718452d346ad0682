"""Where a horizon may end so that the constraints can be met for ever."""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy.optimize import linprog

from ocp.checks.errors import UnsupportedProblem
from ocp.linear.linear_quadratic import Matrices
from ocp.linear.stationary import stationary, with_stationary_end
from ocp.linear.structure import linear_quadratic, read_terms
from ocp.problem.constraint import Constraint
from ocp.problem.ocp import OCP

# A constraint that is exceeded by no more than this, relative to its size, is implied.
_REDUNDANT = 1e-9
# More steps than this are not looked ahead.
_LIMIT = 500
NAME = "terminal set"


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """The points x with C x <= d.

    Attributes:
        C: (rows, n).
        d: (rows,).
    """

    C: np.ndarray
    d: np.ndarray

    def contains(self, x: np.ndarray, tolerance: float = 1e-9) -> bool:
        """Return whether a point (n,) lies inside, up to a tolerance on every row."""
        return bool((self.C @ x <= self.d + tolerance).all())


def terminal_set(ocp: OCP) -> Polyhedron:
    r"""Return the largest set in which the regulator u = -Kx meets the constraints for ever.

    .. math:: O_\infty = \{ x \mid C (A - BK)^i x \le d, \; i = 0, 1, \dots \}

    with all bounds and path constraints as :math:`C x \le d` under u = -Kx, K the gain of the
    infinite horizon. Steps are added until those of one more step are all implied, which one
    linear program per row tells (HiGHS, through scipy); what is implied is left out.
    Source: [Gilbert & Tan 1991].

    Args:
        ocp: discrete in time, a regulator: no drift, no reference, no constraint that changes.

    Raises:
        UnsupportedProblem: what ``linear_quadratic`` and ``stationary`` refuse; where the
            regulator does not rest at the origin, or the constraints have not the origin in
            their interior; where the set takes too many steps.
    """
    lq = linear_quadratic(ocp)
    if lq.steps < 2:  # the only state with a control is then the measured one, never constrained
        raise UnsupportedProblem(f"{ocp.name}: a terminal set is read off two steps at least")
    matrices = _constant(ocp, lq.fixed)
    terms = read_terms(ocp)
    if not ca.vertcat(terms.c, terms.q, terms.r).is_zero():
        raise UnsupportedProblem(
            f"{ocp.name}: a drift or a reference moves the regulator away from the origin, and "
            "with it the terminal set; state the problem in the difference to its rest"
        )
    gain = stationary(matrices, ocp.name).K
    data = lq.on(lq.declared)
    on = matrices.D[-1] @ np.vstack([np.eye(len(gain.T)), -gain])
    rows, limits = _one_sided(on, data.lower[-1], data.upper[-1])
    if any((bound[1:] != bound[-1]).any() for bound in (data.lower, data.upper)):
        raise UnsupportedProblem(f"{ocp.name}: a constraint changes with time or parameters")
    if (limits <= 0.0).any():
        raise UnsupportedProblem(f"{ocp.name}: the origin is not inside all constraints")
    return _admissible(ocp, matrices.A[0] - matrices.B[0] @ gain, rows, limits)


def with_terminal_set(ocp: OCP) -> OCP:
    r"""Return the problem with the infinite-horizon cost and the terminal set at its end.

    With both, a receding horizon of any length stays feasible once it is, and is stable: the
    last plan, shifted and continued by u = -Kx, is a feasible one [Mayne et al. 2000].

    Args:
        ocp: linear-quadratic in discrete time, all matrices constant.

    Raises:
        UnsupportedProblem: what ``terminal_set`` and ``with_stationary_end`` refuse.
    """
    found, ended = terminal_set(ocp), with_stationary_end(ocp)
    end = Constraint(NAME, ca.mtimes(ca.DM(found.C), ocp.model.x), upper=found.d, at="terminal")
    return replace(ended, constraints=(*ended.constraints, end))


def _constant(ocp: OCP, matrices: Matrices | None) -> Matrices:
    if matrices is None or np.ptp(matrices.D, axis=0).any():
        raise UnsupportedProblem(f"{ocp.name}: a terminal set needs constant matrices")
    return matrices


def _one_sided(
    rows: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return l <= Gx <= u as C x <= d, finite bounds only."""
    above, below = np.isfinite(upper), np.isfinite(lower)
    return np.vstack([rows[above], -rows[below]]), np.append(upper[above], -lower[below])


def _admissible(ocp: OCP, closed: np.ndarray, rows: np.ndarray, limits: np.ndarray) -> Polyhedron:
    """Add the constraints of one step after another until they say nothing new."""
    found = Polyhedron(rows[:0], limits[:0])
    ahead = rows
    for _ in range(_LIMIT):
        news = [i for i, limit in enumerate(limits) if _largest(found, ahead[i]) > _implied(limit)]
        if not news:
            return found
        found = _reduced(
            Polyhedron(np.vstack([found.C, ahead[news]]), np.append(found.d, limits[news]))
        )
        ahead = ahead @ closed
    raise UnsupportedProblem(f"{ocp.name}: the terminal set has not ended after {_LIMIT} steps")


def _implied(limit: float) -> float:
    return limit + _REDUNDANT * (1.0 + abs(limit))


def _largest(within: Polyhedron, row: np.ndarray) -> float:
    """Return the largest value of a linear function in a polyhedron with 0 in it."""
    if not len(within.d):
        return np.inf if row.any() else 0.0
    answer = linprog(-row, A_ub=within.C, b_ub=within.d, bounds=(None, None), method="highs")
    return np.inf if answer.x is None else float(row @ answer.x)


def _reduced(given: Polyhedron) -> Polyhedron:
    """Leave out the rows that the others imply, one after another."""
    kept = np.ones(len(given.d), dtype=bool)
    for i in range(len(given.d)):
        kept[i] = False
        others = Polyhedron(given.C[kept], given.d[kept])
        kept[i] = _largest(others, given.C[i]) > _implied(given.d[i])
    return Polyhedron(given.C[kept], given.d[kept])
