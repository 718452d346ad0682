"""Laws for when there is no plan: the saturated regulator, and instantaneous control."""

from collections.abc import Callable
from typing import Literal

import casadi as ca
import numpy as np

from ocp.errors import ProblemError
from ocp.expressions import numbers
from ocp.linear.discretise import discretise
from ocp.linear.stationary import stationary
from ocp.linear.structure import linear_quadratic
from ocp.optimality import derive
from ocp.problem import OCP

# (x, t) -> u (m,).
Feedback = Callable[[np.ndarray, float], np.ndarray]


def saturated_lqr(ocp: OCP, *, dt: float | None = None) -> Feedback:
    r"""Return the regulator of a linear-quadratic problem, clipped to the control bounds.

    .. math::

        u = \mathrm{clip}\bigl(-Kx - (R + B'PB)^{-1} (r + B'(Pc + p))\bigr)

    P and K solve the algebraic Riccati equation, p is the linear term of the cost-to-go; with the
    references of the first stage, as if they stayed for ever. A ``backup`` of ``MPC`` that needs
    no solver; state constraints it does not know.

    Args:
        ocp: linear-quadratic; its horizon and terminal cost play no part.
        dt: sampling interval of a continuous-time problem [s]; None: it is discrete.

    Raises:
        UnsupportedProblem: what ``linear_quadratic`` and ``stationary`` refuse.
    """
    sampled = ocp if dt is None else discretise(ocp, dt)
    lq = linear_quadratic(sampled)
    matrices = lq.sample_matrices(lq.declared)
    regulator, terms = stationary(matrices, ocp.name), lq.on(lq.declared)
    a, b, weight = matrices.A[0], matrices.B[0], matrices.R[0]
    c, q, r = terms.c[0], terms.q[0], terms.r[0]
    k, p = regulator.K, regulator.P
    closed = a - b @ k
    slope = np.linalg.solve(np.eye(len(a)) - closed.T, q - k.T @ r + closed.T @ p @ c)
    offset = np.linalg.solve(weight + b.T @ p @ b, r + b.T @ (p @ c + slope))

    def law(x: np.ndarray, t: float) -> np.ndarray:
        return ocp.control_bounds.clip(-k @ np.asarray(x, dtype=float) - offset)

    return law


def instantaneous(
    ocp: OCP, *, reach: float = 0.1, sent: Literal["control", "rate"] = "control"
) -> Feedback:
    r"""Return the control that is best if the running cost keeps its present slope for a while.

    .. math:: u = \arg\min_u L(x, u) + \tau L_x f(x, u)

    It is the minimum principle with the costate guessed as :math:`\tau L_x'`. For a redundant arm
    the path comes first, as it is in the dynamics, and the cost of the posture is descended in
    the null space, thesis (3.16): prioritised kinematics with two tasks. A ``backup`` of ``MPC``
    that needs no solver; state and path constraints it does not know.

    Args:
        ocp: in continuous time; parameters and signals as it declares them, at their start.
        reach: tau, how long the slope is believed in [s].
        sent: what the plant receives: the control, or the rate of the state, see ``Applied``.

    Raises:
        ProblemError: if the reach is not positive, or ``sent`` is neither.
        UnsupportedProblem: what the minimum principle refuses, see ``derive``.
    """
    if not reach > 0.0:
        raise ProblemError(f"instantaneous control: reach = {reach} s, it must be positive")
    if sent not in ("control", "rate"):
        raise ProblemError(f"instantaneous control: sent = {sent!r} is neither control nor rate")
    m, control = ocp.model, derive(ocp).control
    u0 = ocp.control_bounds.clip(np.zeros(m.nu))
    slope = ca.Function(
        "slope", [m.x, m.u, m.t, ocp.p], [ca.densify(ca.gradient(ca.SX(ocp.running_cost), m.x))]
    )
    p = ocp.parameter_values().at(0.0)[0]

    def law(x: np.ndarray, t: float) -> np.ndarray:
        state = numbers(x, m.nx, f"{ocp.name}: x")
        u = control(state, reach * slope(state, u0, t, p), t, p)
        return np.array(u if sent == "control" else ocp.functions.rate(state, u, t, p)).ravel()

    return law
