"""The second-order test of an extremal: Legendre's condition, and no conjugate point."""

from dataclasses import dataclass

import numpy as np

from solvers.indirect.boundary_value_problem import ExtremalProblem
from solvers.indirect.shooting_segments import SegmentTrajectories, ShootingSchedule

# Columns of the Lagrangian plane this close to dependent count as a conjugate point.
_SINGULAR = 1e-9


@dataclass(frozen=True)
class SecondOrder:
    """The outcome of the test.

    Attributes:
        passed: whether the extremal is a strict local minimum; None where the test does not
            apply.
        reason: what failed, and when, or why it does not apply.
    """

    passed: bool | None
    reason: str = ""


def second_order(
    extremals: ExtremalProblem,
    v: np.ndarray,
    schedule: ShootingSchedule,
    paths: SegmentTrajectories,
) -> SecondOrder:
    r"""Test the sufficient conditions of a weak local minimum along an extremal.

    The solutions of the linearised canonical equations that meet the linearised end
    conditions form a Lagrangian plane, (X, Y) (2 nx, nx) at every instant. Where
    :math:`\det X` does not vanish before the final time, :math:`S = Y X^{-1}` is the bounded
    solution of the Riccati equation, there is no conjugate point, and with
    :math:`H_{uu} > 0` the extremal is a minimum [Bryson & Ho 1975, ch. 6]. On a start
    manifold S has to be positive definite on its tangent as well. Carrying the plane instead
    of S needs no special case for terminal constraints, where S is unbounded at the end.
    Directions of the plane along which X vanishes at every instant, as where the end fixes a
    state that no control changes, admit no variation and are left out.

    Args:
        extremals: the boundary value problem.
        v: its solution.
        schedule: grid of the run.
        paths: trajectory of ``v``.
    """
    ocp = extremals.ocp
    if ocp.has_free_time:
        return SecondOrder(None, "the test is not made for a free final time")
    z, mu, nu, duration = extremals.shape.split(v, schedule.duration)
    concave = concave_at(extremals, paths, schedule, duration)
    if concave is not None:
        return SecondOrder(False, f"H_uu is not positive definite at t = {concave:.4g} s")
    plane, nx = _final_plane(extremals, paths, nu, schedule), ocp.model.nx
    slopes, _ = extremals.step_slopes(paths, schedule, duration)
    plane = plane @ _varied(plane, slopes)
    # Under terminal constraints X vanishes at the end itself, and has to grow out of it.
    grown = _is_regular(plane[:nx])
    for k in range(len(slopes) - 1, -1, -1):
        back = np.linalg.inv(slopes[k])
        before = back @ plane
        turned = grown and _turns_over(plane[:nx], before[:nx], back[:nx, :nx])
        plane = _orthonormal(before)
        regular = _is_regular(plane[:nx])
        if turned or (grown and not regular):
            t = schedule.t0 + schedule.fractions[k] * duration
            return SecondOrder(False, f"conjugate point near t = {t:.4g} s")
        grown = grown or regular
    if ocp.has_free_start:
        return _tangent_curvature(extremals, plane, z[0], mu, schedule)
    return SecondOrder(True)


def _varied(plane: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return a basis of the plane's directions along which X ever differs from 0, (nx, r)."""
    nx = plane.shape[1]
    still, turns = _kernel(plane[:nx]), []
    for slope in slopes[::-1]:
        if not still.size:
            return np.eye(nx)
        plane, turn = np.linalg.qr(np.linalg.solve(slope, plane))
        turns.append(turn)
        still = _orthonormal(turn @ still)
        still = still @ _kernel(plane[:nx] @ still)
    for turn in turns[::-1]:  # the coordinates at the end
        still = _orthonormal(np.linalg.solve(turn, still))
    return np.linalg.svd(still)[0][:, still.shape[1] :]


def _kernel(matrix: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of what a matrix maps to 0, one column each."""
    _, values, rows = np.linalg.svd(matrix)
    rank = int((values > _SINGULAR).sum())
    return rows[rank:].T


def _is_regular(x: np.ndarray) -> bool:
    """Whether the columns are independent, in an orthonormal basis of the plane."""
    return bool(np.linalg.svd(x, compute_uv=False).min(initial=np.inf) > _SINGULAR)


def _turns_over(x: np.ndarray, before: np.ndarray, in_x: np.ndarray) -> bool:
    """Whether X became singular in one step backwards, from ``x`` to ``before``.

    The step is dx = D'(x - B y) with B >= 0, so that X_before = D'(E + B S) X with real
    eigenvalues of E + B S, all positive exactly where no direction has turned over. Unlike the
    sign of det X they also tell when two turn over at once.
    """
    turned = np.linalg.lstsq(x, np.linalg.solve(in_x, before), rcond=None)[0]
    return bool(np.linalg.eigvals(turned).real.min(initial=np.inf) <= 0.0)


def concave_at(
    extremals: ExtremalProblem,
    paths: SegmentTrajectories,
    schedule: ShootingSchedule,
    duration: float,
    below: float = 0.0,
) -> float | None:
    """Return when H_uu, on the free controls, first has an eigenvalue not above ``below``.

    None if it never does. Along a minimum no eigenvalue is negative (Legendre and Clebsch).
    """
    t, x, costate, u = extremals.trajectory(paths, schedule, duration)
    p = np.vstack([schedule.p_left, schedule.p_last])
    box, nu = extremals.ocp.control_bounds, u.shape[1]
    curvature = extremals.optimality.hamiltonian.control_curvature.map(len(t))
    hessians = np.array(curvature(x.T, u.T, costate.T, t[None, :], p.T)).T.reshape(len(t), nu, nu)
    free = (u > np.asarray(box.lower)) & (u < np.asarray(box.upper))
    lowest = np.full(len(t), np.inf)
    for pattern in np.unique(free, axis=0):  # all with the same controls free at once
        if pattern.any():
            at = (free == pattern).all(axis=1)
            inner = hessians[at][:, pattern][:, :, pattern]
            lowest[at] = np.linalg.eigvalsh((inner + inner.transpose(0, 2, 1)) / 2.0)[:, 0]
    found = np.flatnonzero(lowest <= below)
    return float(t[found[0]]) if found.size else None


def _final_plane(
    extremals: ExtremalProblem,
    paths: SegmentTrajectories,
    nu: np.ndarray,
    schedule: ShootingSchedule,
) -> np.ndarray:
    """All (dx, dcostate) that meet the linearised end conditions for some multipliers."""
    t = schedule.t0 + schedule.duration
    _, in_z, in_nu, _ = extremals.ends(paths.ends[-1], nu, t, schedule.p_last)
    conditions = np.hstack([in_z, in_nu])
    _, _, rows = np.linalg.svd(conditions)
    return _orthonormal(rows[len(conditions) :, : in_z.shape[1]].T)


def _orthonormal(plane: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the same plane."""
    return np.linalg.qr(plane)[0]


def _tangent_curvature(
    extremals: ExtremalProblem,
    plane: np.ndarray,
    z0: np.ndarray,
    mu: np.ndarray,
    schedule: ShootingSchedule,
) -> SecondOrder:
    """The cost-to-go must curve upwards along the start manifold, where the start is free at all.

    Variations of the start are dx = X c with c such that dx is tangent to the manifold; their
    second variation is dx' Y c, and what the manifold bends.
    """
    nx, m = extremals.shape.nx, extremals.shape.n_mu
    _, in_z, _ = extremals.starts(z0, mu, schedule.t0, schedule.p_first, z0[:nx])
    normals, bending = in_z[:m, :nx], in_z[m:, :nx]
    tangent = np.linalg.svd(normals)[2][m:]
    across = np.eye(nx) - tangent.T @ tangent
    admitted = plane @ _kernel(across @ plane[:nx])
    _, values, rows = np.linalg.svd(admitted[:nx])
    free = admitted @ rows[: len(values)][values > _SINGULAR].T
    if not free.size:
        return SecondOrder(True)
    dx, dy = free[:nx] / values[values > _SINGULAR], free[nx:] / values[values > _SINGULAR]
    hessian = dx.T @ dy + dx.T @ bending @ dx
    if np.linalg.eigvalsh((hessian + hessian.T) / 2)[0] <= 0.0:
        return SecondOrder(False, "the cost does not curve upwards along the start manifold")
    return SecondOrder(True)
