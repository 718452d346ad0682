"""Whether the Lagrangian curves downwards where the active constraints leave it free."""

import casadi as ca
import numpy as np

from solvers.direct.nlp_result import NlpResult
from solvers.direct.nlp_verdict import NlpInputs

# A bound or inequality is active where the value is this close to it, relative to 1 + abs(value).
_ACTIVE = 1e-6
# Weight of the active rows, relative to the Hessian: it decides between the rows and the curvature.
_WEIGHT = 1e8
# Shift of the Hessian, relative to its size: curvature above minus this counts as none.
_SHIFT = 1e-6


def has_negative_curvature(function: ca.Function, result: NlpResult, inputs: NlpInputs) -> bool:
    r"""Return whether a result is a saddle or a maximum of its program.

    With the Hessian H of the Lagrangian and the slopes A of the active rows, the second-order
    condition holds where

    .. math:: H + \epsilon \lVert H \rVert E + \rho A' A

    is positive definite for a large rho; its sparse factors L D L' tell by the signs of D.

    Args:
        function: the ``casadi.nlpsol`` of fatrop, which has the whole Hessian.
        result: a stationary point with its multipliers.
        inputs: of the run.
    """
    w, p, bounds = result.w, inputs.p, inputs.bounds
    hessian = function.get_function("nlp_hess_l")(w, p, 1.0, result.lam_g)[-1]
    slopes = function.get_function("nlp_jac_g")(w, p)[-1]
    rows = _active(result.g, bounds["lbg"], bounds["ubg"])
    fixed = _active(w, bounds["lbx"], bounds["ubx"]).astype(float)
    size = float(ca.norm_inf(ca.vec(hessian)))
    held = ca.diag(ca.sparsify(ca.DM(fixed)))
    chosen = slopes[[int(i) for i in np.flatnonzero(rows)], :]
    shifted = hessian + _SHIFT * size * ca.DM.eye(len(w))
    factors, _, _ = ca.ldl(shifted + _WEIGHT * size * (chosen.T @ chosen + held))
    return bool(np.array(factors).min() < 0.0)


def _active(value: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    near = _ACTIVE * (1.0 + np.abs(value))
    return (value - lower <= near) | (upper - value <= near)
