"""The Hamiltonian along an optimal trajectory: what it keeps, and where it ends."""

import casadi as ca
import numpy as np

from ocp import OCP, FreeTime, Solution
from ocp.internal import hamiltonian
from solvers.certify.certificate import Check

NAME = "Hamiltonian"
# A final time this close to its bound, relative, is held by it.
_HELD = 1e-6


def hamiltonian_check(solution: Solution, limit: float) -> Check:
    r"""Check that H changes only as the time that is written in the problem makes it.

    .. math:: H(t) - H(t_0) = \int_{t_0}^{t} H_t \, ds, \quad H = L + \lambda' f

    On path constraints that do not depend on time this holds as well, since what they add to H
    is zero along the trajectory. Where the final time is free, not at its bound, and neither
    terminal cost nor terminal constraints depend on it, H itself ends at zero
    [Bryson & Ho 1975, 2.7].

    Args:
        solution: with costates.
        limit: of the residual, relative to 1 + the largest abs(H).
    """
    ocp = solution.problem
    reason = _why_not(ocp)
    if reason:
        return Check.skipped(NAME, reason)
    value, drift = _along(solution)
    scale = 1.0 + float(np.abs(value).max())
    kept = value - drift
    if _ends_at_zero(solution):
        worst = float(np.abs(kept + drift[-1]).max()) / scale
        said = "H = 0 at the free final time, and changes only with the time written in it"
        return Check.at_most(NAME, worst, limit, f"{said}, to {worst:.1e} of 1 + max abs(H)")
    worst = float(kept.max() - kept.min()) / scale
    said = "constant" if not np.any(drift) else "changes only with the time written in it"
    return Check.at_most(NAME, worst, limit, f"{said}, to {worst:.1e} of 1 + max abs(H)")


def _why_not(ocp: OCP) -> str:
    if ocp.model.is_discrete:
        return "in discrete time nothing is conserved"
    signals = [entry.name for entry in ocp.moving]
    if signals:
        return f"signal '{signals[0]}' changes H in a way that H_t does not show"
    paths = [c.name for c in ocp.at("path") if ca.depends_on(c.expression, ocp.model.t)]
    if paths:
        return f"path constraint '{paths[0]}' moves with time and adds its multiplier to H_t"
    return ""


def _ends_at_zero(solution: Solution) -> bool:
    """Whether H vanishes at the end: a free final time without cost or constraint of its own."""
    ocp = solution.problem
    if not isinstance(ocp.horizon, FreeTime) or _ends_depend_on_time(ocp):
        return False
    bounds = np.array([ocp.horizon.lower, ocp.horizon.upper])
    return not bool((np.abs(solution.duration - bounds) <= _HELD * solution.duration).any())


def _ends_depend_on_time(ocp: OCP) -> bool:
    ends = [ca.SX(ocp.terminal_cost), *(c.expression for c in ocp.at("terminal"))]
    return any(ca.depends_on(ca.SX(e), ocp.model.t) for e in ends)


def _along(solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """H at the nodes, and the integral of H_t up to each, by Simpson's rule."""
    h, t = hamiltonian(solution.problem), solution.t
    middle = (t[:-1] + t[1:]) / 2.0
    p = solution.data.values

    def at(times: np.ndarray, function: ca.Function) -> np.ndarray:
        fractions = (times - t[0]) / solution.duration
        rows = (
            solution.state(times),
            solution.control(times),
            solution.costate_at(times),
            times[:, None],
            p.at(fractions),
        )
        return np.array(function.map(len(times))(*[r.T for r in rows])).ravel()

    slope, inside = at(t, h.time_slope), at(middle, h.time_slope)
    growth = np.diff(t) * (slope[:-1] + 4.0 * inside + slope[1:]) / 6.0
    return at(t, h.value), np.concatenate([[0.0], np.cumsum(growth)])
