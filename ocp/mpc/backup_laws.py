"""Laws for when there is no plan: the saturated regulator, and instantaneous control."""

from dataclasses import replace
from typing import Literal, Protocol

import casadi as ca
import numpy as np

from ocp.checks.arguments import check_instance, check_numbers, check_positive
from ocp.checks.errors import ProblemError, UnsupportedProblem
from ocp.linear.discretise import discretise
from ocp.linear.stationary import stationary
from ocp.linear.structure import linear_quadratic
from ocp.minimum_principle.necessary_conditions import minimum_principle
from ocp.problem.constraint import Box
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Parameter, Signal


class ParametricLaw(Protocol):
    """(x, t) -> input (m,), for parameters as declared or as they are now."""

    def __call__(self, x: np.ndarray, t: float, p: np.ndarray | None = None) -> np.ndarray:
        """Return the input.

        Args:
            x: state (nx,).
            t: time [s].
            p: parameters and signals at that time, stacked (n_p,); default: the declared ones,
                of a signal the first sample.
        """
        ...


def saturated_lqr(ocp: OCP, *, dt: float | None = None) -> ParametricLaw:
    r"""Return the regulator of a linear-quadratic problem, clipped to the control bounds.

    .. math::

        u = \mathrm{clip}\bigl(-Kx - (R + B'PB)^{-1} (r + B'(Pc + p))\bigr)

    P and K solve the algebraic Riccati equation, p is the linear term of the cost-to-go; with
    references and parameters as they are at that instant, as if they stayed for ever. A ``backup``
    of ``MPC`` that needs no solver; constraints other than the control bounds it does not know.

    Args:
        ocp: linear dynamics and quadratic running cost; horizon, constraints and terminal cost
            play no part.
        dt: sampling interval of a continuous-time problem [s]; None: it is discrete.

    Raises:
        UnsupportedProblem: what ``linear_quadratic`` and ``stationary`` refuse, and a matrix that
            depends on time or parameters.
    """
    check_instance(ocp, OCP, "saturated_lqr: the problem")
    endless = _endless(ocp, dt)
    lq = linear_quadratic(endless if dt is None else discretise(endless, dt))
    if lq.fixed is None:
        raise UnsupportedProblem(
            f"{ocp.name}: a matrix depends on time or parameters, a regulator needs all of them "
            "constant"
        )
    regulator = stationary(lq.fixed, ocp.name)
    a, b, weight = lq.fixed.A[0], lq.fixed.B[0], lq.fixed.R[0]
    k, cost_to_go = regulator.K, regulator.P
    closed, pressed = a - b @ k, weight + b.T @ cost_to_go @ b
    n, m = ocp.model.nx, ocp.model.nu
    declared = endless.parameter_values().at(0.0)[0]

    def law(x: np.ndarray, t: float, p: np.ndarray | None = None) -> np.ndarray:
        given = declared if p is None else p
        vectors = np.array(lq.stage_vectors(t, given)).ravel()
        c, q, r = vectors[:n], vectors[n : 2 * n], vectors[2 * n : 2 * n + m]
        slope = np.linalg.solve(np.eye(n) - closed.T, q - k.T @ r + closed.T @ cost_to_go @ c)
        offset = np.linalg.solve(pressed, r + b.T @ (cost_to_go @ c + slope))
        return ocp.control_bounds.clip(-k @ np.asarray(x, dtype=float) - offset)

    return law


def _endless(ocp: OCP, dt: float | None) -> OCP:
    """Return one interval of the problem without its end and constraints, its signals at rest.

    Nor does it know rates: whatever acts is moved within them.
    """
    now = tuple(
        entry if isinstance(entry, Parameter) else Parameter(entry.name, entry.symbol, value)
        for entry in ocp.given
        for value in [entry.value[0] if isinstance(entry, Signal) else entry.value]
    )
    return replace(
        ocp,
        horizon=1 if dt is None else dt,
        terminal_cost=0.0,
        constraints=(),
        state_bounds=Box(),
        parameters=now,
        peaks=(),
        rates=(),
        last_input=None,
        guess=None,
    )


def instantaneous(
    ocp: OCP, *, reach: float = 0.1, sent: Literal["control", "rate"] = "control"
) -> ParametricLaw:
    r"""Return the control that is best if the running cost keeps its present slope for a while.

    .. math:: u = \arg\min_u L(x, u) + \tau L_x f(x, u)

    It is the minimum principle with the costate guessed as :math:`\tau L_x'`. For a redundant arm
    the path comes first, as it is in the dynamics, and the cost of the posture is descended in
    the null space, thesis (3.16): prioritised kinematics with two tasks. A ``backup`` of ``MPC``
    that needs no solver; state and path constraints it does not know.

    Args:
        ocp: in continuous time.
        reach: tau, how long the slope is believed in [s].
        sent: what the plant receives: the control, or the rate of the state, see ``PlantInput``.

    Raises:
        ProblemError: if the reach is not positive, or ``sent`` is neither.
        UnsupportedProblem: what the minimum principle refuses, see ``minimum_principle``.
    """
    check_instance(ocp, OCP, "instantaneous: the problem")
    check_positive(reach, "instantaneous control: reach [s]")
    if sent not in ("control", "rate"):
        raise ProblemError(f"instantaneous control: sent = {sent!r} is neither control nor rate")
    ocp = ocp.explicit
    m, control = ocp.model, minimum_principle(ocp).control
    u0 = ocp.control_bounds.clip(np.zeros(m.nu))
    slope = ca.Function(
        "slope", [m.x, m.u, m.t, ocp.p], [ca.densify(ca.gradient(ca.SX(ocp.running_cost), m.x))]
    )
    declared = ocp.parameter_values().at(0.0)[0]

    def law(x: np.ndarray, t: float, p: np.ndarray | None = None) -> np.ndarray:
        state, given = check_numbers(x, m.nx, f"{ocp.name}: x"), declared if p is None else p
        u = control(state, reach * slope(state, u0, t, given), t, given)
        if sent == "rate":
            u = ocp.functions.rate(state, u, t, given)
        return np.array(u).ravel()

    return law
