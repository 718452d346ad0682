"""The referee: what a solution's controls really cost, violate and leave unoptimised."""

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.optimize import lsq_linear

from ocp.constraint import Box, Constraint
from ocp.functions import stacked
from ocp.hamiltonian import hamiltonian
from ocp.problem import OCP
from ocp.solution import Solution
from ocp.truth import Truth, adjoint, follow

# A constraint closer than this to its bound is taken as active, and the costate of the cost
# alone then says nothing about optimality.
_ACTIVE = 1e-5


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The verdict on a solution.

    Attributes:
        cost: true cost, inf if the controls make the state blow up.
        cost_error: change of the cost under the last halving of the steps.
        violation: largest violation of any bound or constraint, between the nodes too.
        worst: which one, and when; empty where nothing is violated.
        stationarity: residual of the minimum principle, max over time of
            abs(u - clip(u - H_u)) with the referee's own costates, for a held control
            averaged over its interval, and of transversality at free ends; None where a path
            constraint or state bound is active (its multiplier would be needed).
        task_drift: largest violation of the problem's invariants.
        defect: largest distance of the solution's states from the true ones at its nodes.
        truth: the trajectory itself.
    """

    cost: float
    cost_error: float
    violation: float
    worst: str
    stationarity: float | None
    task_drift: float
    defect: float
    truth: Truth


def evaluate(solution: Solution, *, tolerance: float = 1e-9) -> Evaluation:
    """Judge a solution by integrating its controls, whatever its solver says.

    Args:
        solution: of any solver, with controls of any kind.
        tolerance: the cost is refined until halving the steps changes it by less, relative.

    Returns:
        the verdict; nothing is raised for a bad trajectory, its numbers are bad.
    """
    truth = follow(solution, tolerance=tolerance)
    if not truth.is_finite:
        return Evaluation(
            cost=np.inf,
            cost_error=np.inf,
            violation=np.inf,
            worst="the state blows up",
            stationarity=None,
            task_drift=np.inf,
            defect=np.inf,
            truth=truth,
        )
    violations = list(_violations(solution, truth))
    worst, violation = max(violations, key=lambda item: item[1], default=("none", 0.0))
    drift = max((v for _, v in _along(solution.problem.invariants, solution, truth)), default=0.0)
    own = np.stack([np.interp(solution.t, truth.t, c) for c in truth.x.T], axis=1)
    return Evaluation(
        cost=truth.cost,
        cost_error=truth.cost_error,
        violation=violation,
        worst=worst if violation > 0.0 else "",
        stationarity=_stationarity(solution, truth),
        task_drift=drift,
        defect=float(np.abs(own - solution.x).max()),
        truth=truth,
    )


def costates_along(solution: Solution) -> Solution:
    """Return the solution with its costates integrated backwards along its own controls.

    Any trajectory can so start an indirect method (also one of a method that knows no
    costates). Where the problem has terminal equations the final costate is the gradient of
    the terminal cost plus the part of the given costate that is normal to them.
    """
    truth = follow(solution)
    if not truth.is_finite:
        return solution
    costates, _, _ = adjoint(solution, truth, _final_costate(solution, truth)[0])
    rows = [np.interp(solution.t, truth.t, c) for c in costates.T]
    return solution.with_(costate=np.stack(rows, axis=1))


# -- constraints --------------------------------------------------------------------


def _violations(solution: Solution, truth: Truth) -> Iterator[tuple[str, float]]:
    """Yield 'what at which time' and by how much, for every bound and constraint."""
    ocp, m = solution.problem, solution.problem.model
    yield from _named("state", m.x_names, ocp.state_bounds, truth.x, truth.t)
    for u, t in ((truth.u_start, truth.t[:-1]), (truth.u_end, truth.t[1:])):
        yield from _named("control", m.u_names, ocp.control_bounds, u, t)
    yield from _along(ocp.at("path"), solution, truth)
    for constraints, row, p in (
        (ocp.at("initial"), 0, truth.p_start[0]),
        (ocp.at("terminal"), -1, _final_p(solution)),
    ):
        for c in constraints:
            value = _at_an_end(ocp, c, truth.x[row], truth.t[row], p)
            yield f"{c.at} constraint '{c.name}'", float(c.box.excess(value).max(initial=0.0))
    yield "final time", float(ocp.time_box.excess(np.array([solution.duration]))[0])


def _named(
    kind: str, names: tuple[str, ...], box: Box, values: np.ndarray, t: np.ndarray
) -> Iterator[tuple[str, float]]:
    excess = box.excess(values)
    for i, name in enumerate(names):
        k = int(excess[:, i].argmax())
        yield f"{kind} {name} at t = {t[k]:.4g} s", float(excess[k, i])


def _along(
    constraints: tuple[Constraint, ...], solution: Solution, truth: Truth
) -> Iterator[tuple[str, float]]:
    """Yield the worst instant of each path constraint, at both ends of every step."""
    for c in constraints:
        for values, t in _path_values(solution.problem, c, truth):
            excess = c.box.excess(values).max(axis=1)
            k = int(excess.argmax())
            yield f"constraint '{c.name}' at t = {t[k]:.4g} s", float(excess[k])


def _path_values(ocp: OCP, c: Constraint, truth: Truth) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    m = ocp.model
    function = ca.Function("c", [m.x, m.u, m.t, ocp.p], [c.expression])
    steps = len(truth.t) - 1
    for x, u, t, p in (
        (truth.x[:-1], truth.u_start, truth.t[:-1], truth.p_start),
        (truth.x[1:], truth.u_end, truth.t[1:], truth.p_end),
    ):
        yield np.array(function.map(steps)(x.T, u.T, t[None, :], p.T)).T, t


def _at_an_end(ocp: OCP, c: Constraint, x: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
    function = ca.Function("c", [ocp.model.x, ocp.model.t, ocp.p], [c.expression])
    return np.array(function(x, t, p)).ravel()


def _final_p(solution: Solution) -> np.ndarray:
    return solution.problem.parameter_values(solution.parameters).at(1.0)[0]


# -- minimum principle --------------------------------------------------------------


def _stationarity(solution: Solution, truth: Truth) -> float | None:
    ocp = solution.problem
    if _path_is_active(solution, truth):
        return None
    final, at_end = _final_costate(solution, truth)
    costates, g0, g1 = adjoint(solution, truth, final)
    if solution.control_kind == "extremal":
        controls, slopes = _pointwise(solution, truth, costates)
    else:
        controls, slopes = _averaged(solution, truth, g0, g1)
    residual = np.abs(controls - ocp.control_bounds.clip(controls - slopes)).max(initial=0.0)
    ends = (
        _start_residual(solution, truth, costates[0]),
        _time_residual(solution, truth, costates, at_end),
    )
    return float(max(residual, *ends))


def _path_is_active(solution: Solution, truth: Truth) -> bool:
    ocp = solution.problem
    boxes = [(ocp.state_bounds, truth.x[1:])]
    for c in ocp.at("path"):
        boxes += [(c.box, values) for values, _ in _path_values(ocp, c, truth)]
    return any(
        bool(
            np.any(values <= np.asarray(box.lower) + _ACTIVE)
            or np.any(values >= np.asarray(box.upper) - _ACTIVE)
        )
        for box, values in boxes
    )


def _pointwise(
    solution: Solution, truth: Truth, costates: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Controls and H_u at the start of each step."""
    gradient = hamiltonian(solution.problem).control_gradient.map(len(truth.u_start))
    slopes = gradient(
        truth.x[:-1].T, truth.u_start.T, costates[:-1].T, truth.t[None, :-1], truth.p_start.T
    )
    return truth.u_start, np.array(slopes).T


def _averaged(
    solution: Solution, truth: Truth, g0: np.ndarray, g1: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Controls and dJ/du of each node or interval, per second of its support."""
    nodes, u = solution.t, solution.u
    steps = np.diff(truth.t)
    middle = (truth.t[1:] + truth.t[:-1]) / 2
    interval = np.clip(np.searchsorted(nodes, middle) - 1, 0, len(nodes) - 2)
    gradient, weight = np.zeros_like(u), np.zeros(len(u))
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
    return u, gradient / weight[:, None]


def _final_costate(solution: Solution, truth: Truth) -> tuple[np.ndarray, float]:
    """Return phi_x + psi_x' nu, and phi_t + nu' psi_t, with the best multipliers.

    Those of active terminal constraints are fitted to the solution's own costate.
    """
    ocp, m = solution.problem, solution.problem.model
    psi, phi = stacked(ocp.at("terminal")), ca.SX(ocp.terminal_cost)
    ends = ca.Function(
        "ends",
        [m.x, m.t, ocp.p],
        [psi, *(ca.jacobian(e, s) for e in (phi, psi) for s in (m.x, m.t))],
    )
    answer = ends(truth.x[-1], truth.t[-1], _final_p(solution))
    value, phi_x, phi_t, psi_x, psi_t = (np.array(v, dtype=float) for v in answer)
    target = solution.costate[-1] - phi_x.ravel()
    nu = _multipliers(ocp.at("terminal"), value.ravel(), psi_x, target)
    return phi_x.ravel() + psi_x.T @ nu, float(phi_t.sum() + nu @ psi_t.ravel())


def _multipliers(
    constraints: tuple[Constraint, ...], value: np.ndarray, jacobian: np.ndarray, target: np.ndarray
) -> np.ndarray:
    """Return the multipliers for which jacobian' nu is nearest to a target.

    0 where inactive, at least 0 at an upper bound, at most 0 at a lower one.
    """
    lower = np.concatenate([[], *[np.asarray(c.lower) for c in constraints]])
    upper = np.concatenate([[], *[np.asarray(c.upper) for c in constraints]])
    least = np.where(value <= lower + _ACTIVE, -np.inf, 0.0)
    most = np.where(value >= upper - _ACTIVE, np.inf, 0.0)
    nu, active = np.zeros(len(value)), least < most
    if active.any():
        signs = (least[active], most[active])
        nu[active] = lsq_linear(jacobian[active].T, target, signs, method="bvls").x
    return nu


def _start_residual(solution: Solution, truth: Truth, costate: np.ndarray) -> float:
    """Distance of the initial costate from the normals of the start manifold."""
    ocp, m = solution.problem, solution.problem.model
    if not ocp.has_free_start:
        return 0.0
    c = stacked(ocp.at("initial"))
    function = ca.Function("c", [m.x, m.t, ocp.p], [c, ca.jacobian(c, m.x)])
    value, jacobian = function(truth.x[0], truth.t[0], truth.p_start[0])
    normals = np.array(jacobian)
    mu = _multipliers(ocp.at("initial"), np.array(value).ravel(), normals, -costate)
    return float(np.abs(costate + normals.T @ mu).max(initial=0.0))


def _time_residual(solution: Solution, truth: Truth, costates: np.ndarray, at_end: float) -> float:
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
    mean = (left[::2] + 4.0 * right[::2] + right[1::2]) @ np.diff(truth.t)[::2] / 3.0
    duration = np.array([solution.duration])
    slope = mean / solution.duration + at_end
    return float(np.abs(duration - ocp.time_box.clip(duration - slope))[0])
