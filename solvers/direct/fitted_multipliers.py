"""Multipliers fitted to a point: how close to an optimum it is, whatever a backend's own say."""

from dataclasses import replace
from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy.sparse import bmat, csc_matrix, csr_matrix, eye, vstack
from scipy.sparse.linalg import splu

from solvers.direct.nlp_result import NlpResult

# A bound may be active where the value is this close to it, relative to 1 + abs(value); what the
# distance is worth counts as residual.
_ACTIVE = 1e-3
# Weight of the multipliers' own size: it chooses the smallest where constraints depend on
# each other.
_SMALLEST = 1e-10
# How often multipliers of the wrong sign are dropped and the others fitted again.
_ROUNDS = 10


def with_fitted_multipliers(
    function: ca.Function,
    result: NlpResult,
    p: np.ndarray,
    bounds: dict[str, np.ndarray],
    is_control: np.ndarray,
) -> NlpResult:
    r"""Return a result with multipliers of its active constraints, and their residual.

    .. math:: \min_\lambda \lVert f_w + A' \lambda \rVert_2^2 + \epsilon \lVert \lambda \rVert_2^2

    Where the gradients of active constraints depend on each other a backend's multipliers grow
    without bound, and its residual with them, at an optimum too. The residual is the largest
    entry of the gradient that is left, relative to the largest sum of the absolute values of its
    terms: for the controls and for the states on their own, so that it depends neither on the
    number of intervals nor on the unit of the cost. Multipliers of the wrong sign are dropped.
    Where the point is not on an active bound, the sum of multiplier times distance counts, relative
    to the cost. Where the backend's own multipliers leave less they are kept.

    Args:
        function: the ``casadi.nlpsol``.
        result: of one run, that meets the constraints.
        p: data of the problem.
        bounds: lbx, ubx, lbg, ubg.
        is_control: which unknowns are controls, bool (size,).
    """
    w, size, count = result.w, len(result.w), len(result.g)
    gradient = np.array(function.get_function("nlp_grad_f")(x=w, p=p)["grad_f_x"]).ravel()
    slopes = csc_matrix(function.get_function("nlp_jac_g")(x=w, p=p)["jac_g_x"].sparse())
    if not (np.isfinite(gradient).all() and np.isfinite(slopes.data).all()):
        return replace(result, residual=np.inf)
    rows = csr_matrix(vstack([slopes, eye(size)]))
    values = np.concatenate([result.g, w])
    lower = np.concatenate([bounds["lbg"], bounds["lbx"]])
    upper = np.concatenate([bounds["ubg"], bounds["ubx"]])
    near = _ACTIVE * (1.0 + np.abs(values))
    at_lower, at_upper = values - lower <= near, upper - values <= near
    fitted, active = np.zeros(len(values)), at_lower | at_upper
    for _ in range(_ROUNDS):
        chosen = np.flatnonzero(active)
        fitted[:] = 0.0
        fitted[chosen] = _fit(csr_matrix(rows[chosen]), -gradient)
        wrong = ((fitted > 0.0) & ~at_upper) | ((fitted < 0.0) & ~at_lower)
        fitted[wrong] = 0.0
        if not wrong.any():
            break
        active &= ~wrong
    program = _Program(gradient, rows, values, lower, upper)
    own = np.concatenate([result.lam_g, result.lam_x])
    candidates = [(program.residual(each, result, is_control), each) for each in (fitted, own)]
    residual, chosen = min(candidates, key=lambda pair: pair[0])
    return replace(result, lam_g=chosen[:count], lam_x=chosen[count:], residual=residual)


class _Program(NamedTuple):
    """Gradients of cost and rows at a point, and the rows' values and bounds."""

    gradient: np.ndarray
    rows: csr_matrix
    values: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def residual(self, multipliers: np.ndarray, result: NlpResult, is_control: np.ndarray) -> float:
        """Return how far these multipliers are from the first-order conditions."""
        left = np.abs(self.gradient + self.rows.T @ multipliers)
        terms = np.abs(self.gradient) + abs(self.rows).T @ np.abs(multipliers)
        above, below = np.maximum(multipliers, 0.0), np.maximum(-multipliers, 0.0)
        gap = _worth(above, self.upper - self.values) + _worth(below, self.values - self.lower)
        return max(
            _share(left[is_control], terms[is_control]),
            _share(left[~is_control], terms[~is_control]),
            _share(gap, abs(result.cost) + np.abs(self.gradient * result.w).max()),
        )


def _worth(multipliers: np.ndarray, distance: np.ndarray) -> float:
    """Return the sum of multiplier times distance; inf where a bound is none."""
    counts = multipliers > 0.0
    return float(np.abs(multipliers[counts] * distance[counts]).sum())


def _fit(rows: csr_matrix, wanted: np.ndarray) -> np.ndarray:
    """Return the multipliers of rows whose combination is nearest to a gradient."""
    size = len(wanted)
    count = int(rows.indptr.size) - 1
    blocks = [[eye(size), rows.T], [rows, -_SMALLEST * eye(count)]]
    system = csc_matrix(bmat(blocks))
    return splu(system).solve(np.concatenate([wanted, np.zeros(count)]))[size:]


def _share(part: np.ndarray | float, whole: np.ndarray | float) -> float:
    """Return the largest part relative to the largest whole; 0 where there is no part.

    inf where there is a part of nothing: multipliers of a problem without a cost.
    """
    largest, total = float(np.max(part, initial=0.0)), float(np.max(whole, initial=0.0))
    if largest == 0.0:
        return 0.0
    return largest / total if total > 0.0 else np.inf
