"""The residual of the minimum principle along the true trajectory of a solution."""

import numpy as np
from scipy.optimize import lsq_linear

from ocp.minimum_principle.hamiltonian import hamiltonian
from ocp.problem.constraint import Box
from ocp.referee.reference_trajectory import ReferenceTrajectory, adjoint
from ocp.referee.violation import path_values
from ocp.solution.solution import Solution

# A constraint closer than this to its bound is taken as active, and the costate of the cost
# alone then says nothing about optimality.
_ACTIVE = 1e-5


def stationarity(solution: Solution, truth: ReferenceTrajectory) -> float | None:
    """Return the residual of the minimum principle with the referee's own costates.

    The largest of abs(u - clip(u - H_u)) over time (for held, linear and polynomial controls
    dJ/du of their values or coefficients, per second of their support), of the costate's
    distance from the normals of the start manifold, and of the natural residual of a free
    final time. None where a path constraint or a state bound is active: its multiplier would
    be needed; and where the trajectory has no adjoint, see ``ReferenceTrajectory``.
    """
    ocp = solution.problem
    if not truth.has_adjoint or _path_is_active(solution, truth):
        return None
    final, at_end = final_costate(solution, truth)
    costates, gradients = adjoint(solution, truth, final)
    if solution.control_kind == "extremal":
        controls, slopes = _pointwise(solution, truth, costates)
    elif solution.control_kind == "polynomial":
        controls, slopes = _by_coefficient(solution, truth, gradients)
    else:
        controls, slopes = _averaged(solution, truth, *gradients)
    residual = np.abs(controls - ocp.control_bounds.clip(controls - slopes)).max(initial=0.0)
    ends = (
        _start_residual(solution, truth, costates[0]),
        _time_residual(solution, truth, costates, at_end),
    )
    return float(max(residual, *ends))


def _path_is_active(solution: Solution, truth: ReferenceTrajectory) -> bool:
    ocp = solution.problem
    path = ocp.rows.path.box
    boxes = [(ocp.state_bounds, truth.x[1:])]
    boxes += [(path, values) for values, _ in path_values(solution, truth)]
    return any(
        bool(
            np.any(values <= np.asarray(box.lower) + _ACTIVE)
            or np.any(values >= np.asarray(box.upper) - _ACTIVE)
        )
        for box, values in boxes
    )


def _pointwise(
    solution: Solution, truth: ReferenceTrajectory, costates: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Controls and H_u at the start of each step."""
    gradient = hamiltonian(solution.problem).control_gradient.map(len(truth.u_start))
    slopes = gradient(
        truth.x[:-1].T, truth.u_start.T, costates[:-1].T, truth.t[None, :-1], truth.p_start.T
    )
    return truth.u_start, np.array(slopes).T


def _averaged(
    solution: Solution, truth: ReferenceTrajectory, g0: np.ndarray, g1: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Controls and dJ/du of each node or interval, per second of its support."""
    nodes, u = solution.t, solution.u
    steps = np.diff(truth.t)
    middle = (truth.t[1:] + truth.t[:-1]) / 2
    interval = np.clip(np.searchsorted(nodes, middle) - 1, 0, len(nodes) - 2)
    gradient, weight = np.zeros(u.shape), np.zeros(len(u))
    if solution.control_kind == "held":
        np.add.at(gradient, interval, g0 + g1)
        np.add.at(weight, interval, steps)
    else:
        for g, t in ((g0, truth.t[:-1]), (g1, truth.t[1:])):
            right = (t - nodes[interval]) / np.diff(nodes)[interval]
            for node, share in ((interval, 1.0 - right), (interval + 1, right)):
                np.add.at(gradient, node, share[:, None] * g)
                np.add.at(weight, node, share * steps / 2)
    if solution.problem.model.is_discrete:
        weight[:] = 1.0
    # A node so close to the next that no step of the truth lies between has no support.
    supported = weight > 0.0
    gradient[supported] /= weight[supported, None]
    return u, gradient


def _by_coefficient(
    solution: Solution, truth: ReferenceTrajectory, gradients: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients and dJ/dc of each, per second of its support (the integral of its basis)."""
    pieces, t = solution.pieces, truth.t
    middle = (t[1:] + t[:-1]) / 2
    piece, gradient = pieces.of(middle), np.zeros_like(pieces.coefficients)
    for g, at in zip(gradients, (t[:-1], middle, t[1:]), strict=True):
        np.add.at(gradient, piece, pieces.basis(at, piece)[:, :, None] * g[:, None, :])
    weight = np.diff(pieces.edges) / pieces.coefficients.shape[1]
    return solution.u, (gradient / weight[:, None, None]).reshape(solution.u.shape)


def final_costate(solution: Solution, truth: ReferenceTrajectory) -> tuple[np.ndarray, float]:
    """Return phi_x + psi_x' nu, and phi_t + nu' psi_t, with the best multipliers.

    Those of active terminal constraints are fitted to the solution's own costate.
    """
    functions = solution.problem.functions
    end = (truth.x[-1], truth.t[-1], solution.data.values.at(1.0)[0])
    phi_x, psi = (np.array(f(*end)) for f in (functions.terminal_gradient, functions.terminal))
    phi_t, psi_x, psi_t = (np.array(v) for v in functions.terminal_slopes(*end))
    target = solution.costate[-1] - phi_x.ravel()
    nu = _multipliers(solution.problem.rows.terminal.box, psi.ravel(), psi_x, target)
    return phi_x.ravel() + psi_x.T @ nu, float(phi_t.sum() + nu @ psi_t.ravel())


def _multipliers(
    box: Box, value: np.ndarray, jacobian: np.ndarray, target: np.ndarray
) -> np.ndarray:
    """Return the multipliers for which jacobian' nu is nearest to a target.

    0 where inactive, at least 0 at an upper bound, at most 0 at a lower one.
    """
    lower, upper = np.asarray(box.lower), np.asarray(box.upper)
    # An equation pulls either way, also where it is missed.
    equation = lower == upper
    least = np.where(equation | (value <= lower + _ACTIVE), -np.inf, 0.0)
    most = np.where(equation | (value >= upper - _ACTIVE), np.inf, 0.0)
    nu, active = np.zeros(len(value)), least < most
    if active.any():
        signs = (least[active], most[active])
        nu[active] = lsq_linear(jacobian[active].T, target, signs, method="bvls").x
    return nu


def _start_residual(solution: Solution, truth: ReferenceTrajectory, costate: np.ndarray) -> float:
    """Distance of the initial costate from the normals of the start manifold."""
    ocp = solution.problem
    if not ocp.has_free_start:
        return 0.0
    begin = (truth.x[0], truth.t[0], truth.p_start[0])
    value, normals = (
        np.array(f(*begin)) for f in (ocp.functions.initial, ocp.functions.initial_slope)
    )
    free, box, start = ocp.start_is_free, ocp.start_box, truth.x[0]
    mu = _multipliers(ocp.rows.initial.box, value.ravel(), normals[:, free], -costate[free])
    # Natural residual of the box.
    moved = box.clip(start - (costate + normals.T @ mu))
    return float(np.abs(start - moved)[free].max(initial=0.0))


def _time_residual(
    solution: Solution, truth: ReferenceTrajectory, costates: np.ndarray, at_end: float
) -> float:
    """Natural residual of the duration T, from dJ/dT for controls that stretch with it.

    With time and signals written as fractions of the horizon,
    dJ/dT = phi_t + nu' psi_t + mean(H + (t - t0) H_t), which is H(t_f) + phi_t + nu' psi_t
    along an extremal without signals. By Simpson's rule over pairs of steps.
    """
    ocp, steps = solution.problem, len(truth.t) - 1
    if not ocp.has_free_time:
        return 0.0
    h = hamiltonian(ocp)
    now = [c.T for c in (truth.x[:-1], truth.u_start, costates[:-1], truth.t[:-1, None])]
    then = [c.T for c in (truth.x[1:], truth.u_end, costates[1:], truth.t[1:, None])]
    left, right = (
        np.array(h.value.map(steps)(*at, p.T)).ravel()
        + (at[3].ravel() - truth.t[0]) * np.array(h.time_slope.map(steps)(*at, p.T)).ravel()
        for at, p in ((now, truth.p_start), (then, truth.p_end))
    )
    mean = float(truth.integral(left[:, None], right[:, None])[0]) / solution.duration
    duration = np.array([solution.duration])
    slope = mean + at_end
    return float(np.abs(duration - ocp.time_box.clip(duration - slope))[0])
