"""The trajectory that a solution's controls really produce, integrated until it holds still."""

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ocp.integration.one_step import RK4, Stage, interpolate
from ocp.minimum_principle.necessary_conditions import (
    MinimumPrinciple,
    minimum_principle,
    symbol_type,
)
from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.referee.chunked_rollout import ChunkedRollout
from ocp.solution.solution import Solution

# Refinement stops at this many integration steps whatever the error still is.
_MOST_STEPS = 2**15
_FEWEST_STEPS = 400
_FEWEST_PER_INTERVAL = 4


@dataclass(frozen=True, eq=False)
class ReferenceTrajectory:
    """A solution's controls applied to its problem, on a fine grid of K steps.

    Attributes:
        t: (K + 1,) [s].
        x: (K + 1, nx).
        u_start: control at the start of each step, (K, nu).
        u_end: control at the end of each step (its limit from the left), (K, nu).
        u_middle: control in the middle of each step (polynomials), (K, nu).
        p_start: parameters at the start of each step, (K, n_p).
        p_end: parameters at the end of each step, (K, n_p).
        cost: running plus terminal cost.
        cost_error: by how much the last refinement changed the cost.
        inner: states of the control law at the start of each step (extremals), (K, 2 nx).
        substeps: steps per interval of the solution.
    """

    t: np.ndarray
    x: np.ndarray
    u_start: np.ndarray
    u_end: np.ndarray
    p_start: np.ndarray
    p_end: np.ndarray
    cost: float
    cost_error: float
    inner: np.ndarray
    u_middle: np.ndarray
    substeps: int

    @property
    def is_finite(self) -> bool:
        """Whether the integration stayed finite."""
        return bool(np.isfinite(self.cost) and np.isfinite(self.x).all())


def integrate_controls(solution: Solution, *, tolerance: float = 1e-9) -> ReferenceTrajectory:
    """Integrate a solution's controls from its start, refining until cost and end hold still.

    The steps are halved until the cost changes by less than ``tolerance`` (relative to
    1 + cost) and the final state by less than a thousand times that: close to a singular
    configuration it goes on moving long after the cost has settled.

    Args:
        solution: controls of any kind; the start is the one that was asked for, or the
            solution's own where the problem leaves it free.
        tolerance: accepted change of the cost under halving the steps.

    Returns:
        the finest trajectory; not finite if the integration blows up.
    """
    if solution.problem.model.is_discrete:
        return _roll(solution, 1)
    intervals = len(_knots(solution)) - 1
    substeps = max(_FEWEST_PER_INTERVAL, -(-_FEWEST_STEPS // intervals))
    truth = _roll(solution, substeps)
    while truth.is_finite and 2 * substeps * intervals <= _MOST_STEPS:
        substeps *= 2
        finer = _roll(solution, substeps)
        change = abs(finer.cost - truth.cost) / (1.0 + abs(finer.cost))
        moved = np.abs(finer.x[-1] - truth.x[-1]).max() / (1.0 + np.abs(finer.x[-1]).max())
        truth = replace(finer, cost_error=abs(finer.cost - truth.cost))
        if change <= tolerance and moved <= 1e3 * tolerance:
            break
    return truth


def adjoint(
    solution: Solution, truth: ReferenceTrajectory, final: np.ndarray
) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Return costates (K + 1, nx), and gradients dJ/du at both ends of each step, (K, nu) each.

    Between those of the ends stands that of the middle, where the control is polynomial.
    The adjoint of the discretised trajectory itself, from ``final`` backwards: consistent
    to the order of the integrator, with no error of its own. For an extremal the gradients
    are zero: its controls have no parameters.
    """
    machine = _machine(solution)
    inputs = _adjoint_inputs(solution, truth)
    costate, *gradients = machine.adjoint([final], [array[::-1] for array in inputs])
    return np.vstack([costate[::-1], final]), tuple(g[::-1] for g in gradients)


def _adjoint_inputs(solution: Solution, truth: ReferenceTrajectory) -> list[np.ndarray]:
    steps = np.diff(truth.t)[:, None]
    drive = {
        "extremal": [truth.inner],
        "polynomial": [truth.u_start, truth.u_middle, truth.u_end],
    }.get(solution.control_kind, [truth.u_start, truth.u_end])
    return [truth.x[:-1], *drive, truth.t[:-1, None], steps, truth.p_start, truth.p_end]


def _knots(solution: Solution) -> np.ndarray:
    """Fractions of the horizon between which controls and signals are smooth."""
    values = solution.problem.parameter_values(solution.parameters)
    knots = np.union1d(solution.fractions, values.knots)
    return knots[np.concatenate([[True], np.diff(knots) > 1e-9])]


def _roll(solution: Solution, substeps: int) -> ReferenceTrajectory:
    ocp = solution.problem
    knots = solution.fractions if ocp.model.is_discrete else _knots(solution)
    inside = np.arange(substeps) / substeps
    fine = np.append((knots[:-1, None] + inside * np.diff(knots)[:, None]).ravel(), 1.0)
    t = solution.t[0] + fine * solution.duration
    values = ocp.parameter_values(solution.parameters)
    p_start, p_end = values.on(fine)
    start = solution.x[0] if ocp.has_free_start else solution.x0
    schedule = [t[:-1, None], np.diff(t)[:, None], p_start, p_end]
    follow_controls = _ROLLS.get(solution.control_kind, _roll_controls)
    x, cost, u_start, u_end, inner, u_middle = follow_controls(solution, fine, start, schedule)
    cost += float(ocp.functions.terminal_cost(x[-1], t[-1], values.at(1.0)[0]))
    return ReferenceTrajectory(
        t=t,
        x=x,
        u_start=u_start,
        u_end=u_end,
        p_start=p_start,
        p_end=p_end,
        cost=cost,
        cost_error=0.0,
        inner=inner,
        u_middle=u_middle,
        substeps=substeps,
    )


Rolled = tuple[np.ndarray, float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _roll_controls(
    solution: Solution, fine: np.ndarray, start: np.ndarray, schedule: list
) -> Rolled:
    """Held or linear controls: known functions of time."""
    nodes = solution.fractions
    if solution.control_kind == "held":
        middle = (fine[1:] + fine[:-1]) / 2
        u_start = solution.u[np.clip(np.searchsorted(nodes, middle) - 1, 0, len(solution.u) - 1)]
        u_end = u_start
    else:
        u = np.stack([np.interp(fine, nodes, c) for c in solution.u.T], axis=1)
        u_start, u_end = u[:-1], u[1:]
    machine = _machine(solution)
    x, costs = machine.step([start], [u_start, u_end, *schedule])
    nothing = np.empty((len(u_start), 0))
    return np.vstack([start, x]), float(costs.sum()), u_start, u_end, nothing, nothing


def _roll_polynomials(
    solution: Solution, fine: np.ndarray, start: np.ndarray, schedule: list
) -> Rolled:
    """Polynomials from break to break: a step of RK4 sees both ends and the middle exactly."""
    t = solution.t[0] + fine * solution.duration
    middle, pieces = (t[1:] + t[:-1]) / 2, solution.pieces
    piece = pieces.of(middle)
    u_start, u_middle, u_end = (pieces.at(at, piece) for at in (t[:-1], middle, t[1:]))
    x, costs = _machine(solution).step([start], [u_start, u_middle, u_end, *schedule])
    nothing = np.empty((len(u_start), 0))
    return np.vstack([start, x]), float(costs.sum()), u_start, u_end, nothing, u_middle


def _roll_extremal(
    solution: Solution, fine: np.ndarray, start: np.ndarray, schedule: list
) -> Rolled:
    """The control minimising H along (x, costate), both restarted at the solution's nodes.

    The plant's own state runs through: the control is a function of time, as it would be
    applied, and errors of the solution are not healed at the nodes.
    """
    node = np.searchsorted(solution.fractions, fine[:-1] + 1e-12, side="right") - 1
    restart = np.append(True, np.diff(node) > 0).astype(float)[:, None]
    z_node = np.hstack([solution.x, solution.costate])[node]
    machine = _machine(solution)
    inputs = [restart, z_node, *schedule]
    x, _, costs, inner, u_start, u_end = machine.step([start, z_node[0]], inputs)
    nothing = np.empty((len(u_start), 0))
    return np.vstack([start, x]), float(costs.sum()), u_start, u_end, inner, nothing


_ROLLS = {"extremal": _roll_extremal, "polynomial": _roll_polynomials}


@dataclass(frozen=True, eq=False)
class _Machine:
    """The steps that one kind of control needs."""

    step: ChunkedRollout
    adjoint: ChunkedRollout


def _machine(solution: Solution) -> _Machine:
    machines = {"extremal": _extremal_machine, "polynomial": _polynomial_machine}
    return machines.get(solution.control_kind, _control_machine)(solution.problem)


@once_per_problem
def _control_machine(ocp: OCP) -> _Machine:
    stage = Stage.of(ocp, RK4(), held=False)
    return _Machine(step=ChunkedRollout(stage.step), adjoint=ChunkedRollout(stage.adjoint))


@once_per_problem
def _polynomial_machine(ocp: OCP) -> _Machine:
    stage = Stage.of(ocp, RK4(), held=False, curved=True)
    return _Machine(step=ChunkedRollout(stage.step), adjoint=ChunkedRollout(stage.adjoint))


@once_per_problem
def _extremal_machine(ocp: OCP) -> _Machine:
    optimality, functions, nx, n_p = (
        minimum_principle(ocp),
        ocp.functions,
        ocp.model.nx,
        ocp.p.numel(),
    )
    kind = symbol_type(optimality.flow)
    x, z, z_node = kind.sym("x", nx), kind.sym("z", 2 * nx), kind.sym("z_node", 2 * nx)
    restart, t, h = kind.sym("restart"), kind.sym("t"), kind.sym("h")
    p0, p1, costate = kind.sym("p0", n_p), kind.sym("p1", n_p), kind.sym("costate", nx)
    begin = kind.sym("begin", 2 * nx)

    law = _control_of_time(optimality)

    def rate(y: Any, s: Any) -> Any:  # SX or MX, as the control is closed or implicit
        """d(x, cost, z)/ds; the control is that of z, not of x."""
        at, p = t + s * h, interpolate(p0, p1, s)
        u, flow = law(y[nx + 1 :], at, p)
        plant = (functions.rate(y[:nx], u, at, p), functions.running_cost(y[:nx], u, at, p))
        return h * ca.vertcat(*plant, flow)

    end = RK4()(rate, ca.vertcat(x, 0, begin), 0.0, 1.0)
    x_next, cost, z_next = end[:nx], end[nx], end[nx + 1 :]
    u_start = optimality.control(begin[:nx], begin[nx:], t, p0)
    u_end = optimality.control(z_next[:nx], z_next[nx:], t + h, p1)
    core_inputs = [x, begin, t, h, p0, p1]
    zero, total = kind.zeros(ocp.model.nu), cost + ca.dot(costate, x_next)
    adjoint_step = ca.Function(
        "adjoint", [costate, *core_inputs], [ca.gradient(total, x), zero, zero]
    )
    core = ca.Function("core", core_inputs, [x_next, z_next, cost, u_start, u_end])
    chosen = ca.if_else(restart > 0.5, z_node, z)
    x_next, z_next, cost, u_start, u_end = core(x, chosen, t, h, p0, p1)
    step = ca.Function(
        "step",
        [x, z, restart, z_node, t, h, p0, p1],
        [x_next, z_next, cost, chosen, u_start, u_end],
    )
    return _Machine(step=ChunkedRollout(step, carried=2), adjoint=ChunkedRollout(adjoint_step))


def _control_of_time(optimality: MinimumPrinciple) -> ca.Function:
    """(z, t, p) -> the minimising control and dz/dt, through which no derivative passes.

    What is applied is a function of time; and where the control is an implicit root that was
    not found, its derivative does not exist.
    """
    flow = optimality.flow
    z, t, p = inputs = [
        symbol_type(flow).sym(flow.name_in(i), flow.sparsity_in(i)) for i in range(3)
    ]
    nx = z.numel() // 2
    outputs = [optimality.control(z[:nx], z[nx:], t, p), flow(*inputs)]
    return ca.Function("law", inputs, outputs, {"is_diff_in": [False] * 3})
