"""Integrate the controls of a solution on a given grid: a class for each kind of control."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

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


class Steps(NamedTuple):
    """The steps of an integration, with the parameters at both ends of each.

    Attributes:
        fractions: of the horizon, (K + 1,).
        t: (K + 1,) [s].
        p_start: (K, n_p).
        p_end: (K, n_p).
    """

    fractions: np.ndarray
    t: np.ndarray
    p_start: np.ndarray
    p_end: np.ndarray

    @property
    def columns(self) -> list[np.ndarray]:
        """What every step takes besides states and controls: t, h, p0, p1."""
        return [self.t[:-1, None], np.diff(self.t)[:, None], self.p_start, self.p_end]


class Integrated(NamedTuple):
    """What controls do on a grid of K steps.

    Attributes:
        x: states (K + 1, nx).
        running_cost: its integral.
        u_start: control at the start of each step, (K, nu).
        u_end: control at the end of each step (its limit from the left), (K, nu).
        drive: what determines the control in each step, as the adjoint takes it.
    """

    x: np.ndarray
    running_cost: float
    u_start: np.ndarray
    u_end: np.ndarray
    drive: tuple[np.ndarray, ...]


@dataclass(frozen=True, eq=False)
class ControlIntegrator(ABC):
    """Steps of RK4 under controls of one kind, and their exact adjoint.

    Attributes:
        step: from state to state.
        adjoint: (costate after, x, drive, t, h, p0, p1) -> (costate before, dJ/du ...).
    """

    step: ChunkedRollout
    adjoint: ChunkedRollout

    @classmethod
    @abstractmethod
    def of(cls, ocp: OCP) -> Self:
        """Build the steps of a problem."""

    @abstractmethod
    def integrate(self, solution: Solution, steps: Steps, start: np.ndarray) -> Integrated:
        """Apply the controls of a solution from a start (nx,)."""


class _KnownControls(ControlIntegrator):
    """Controls that are given functions of time."""

    def _along(self, steps: Steps, start: np.ndarray, drive: tuple[np.ndarray, ...]) -> Integrated:
        x, costs = self.step([start], [*drive, *steps.columns])
        return Integrated(np.vstack([start, x]), float(costs.sum()), drive[0], drive[-1], drive)


class HeldControls(_KnownControls):
    """Controls held from node to node."""

    @classmethod
    def of(cls, ocp: OCP) -> Self:
        """Build the steps."""
        stage = Stage.of(ocp, RK4(), held=False)
        return cls(ChunkedRollout(stage.step), ChunkedRollout(stage.adjoint))

    def integrate(self, solution: Solution, steps: Steps, start: np.ndarray) -> Integrated:
        """Hold them."""
        middle = (steps.fractions[1:] + steps.fractions[:-1]) / 2
        node = np.searchsorted(solution.fractions, middle) - 1
        u = solution.u[np.clip(node, 0, len(solution.u) - 1)]
        return self._along(steps, start, (u, u))


class LinearControls(HeldControls):
    """Controls linear from node to node: the same steps."""

    def integrate(self, solution: Solution, steps: Steps, start: np.ndarray) -> Integrated:
        """Interpolate them."""
        nodes = solution.fractions
        u = np.stack([np.interp(steps.fractions, nodes, c) for c in solution.u.T], axis=1)
        return self._along(steps, start, (u[:-1], u[1:]))


class PolynomialControls(_KnownControls):
    """Polynomials from break to break: a step sees both ends and the middle exactly."""

    @classmethod
    def of(cls, ocp: OCP) -> Self:
        """Build the steps."""
        stage = Stage.of(ocp, RK4(), held=False, curved=True)
        return cls(ChunkedRollout(stage.step), ChunkedRollout(stage.adjoint))

    def integrate(self, solution: Solution, steps: Steps, start: np.ndarray) -> Integrated:
        """Evaluate them."""
        t, pieces = solution.t[0] + steps.fractions * solution.duration, solution.pieces
        middle = (t[1:] + t[:-1]) / 2
        piece = pieces.of(middle)
        u_start, u_middle, u_end = (pieces.at(at, piece) for at in (t[:-1], middle, t[1:]))
        return self._along(steps, start, (u_start, u_middle, u_end))


class ExtremalControls(ControlIntegrator):
    """The control minimising H along (x, costate), both restarted at the solution's nodes.

    The plant's own state runs through: the control is a function of time, as it would be
    applied, and errors of the solution are not healed at the nodes. It has no parameters, so
    the adjoint's gradients are zero.
    """

    @classmethod
    def of(cls, ocp: OCP) -> Self:
        """Build the steps."""
        conditions, functions, nx, n_p = (
            minimum_principle(ocp),
            ocp.functions,
            ocp.model.nx,
            ocp.p.numel(),
        )
        kind = symbol_type(conditions.flow)
        x, z, z_node = kind.sym("x", nx), kind.sym("z", 2 * nx), kind.sym("z_node", 2 * nx)
        restart, t, h = kind.sym("restart"), kind.sym("t"), kind.sym("h")
        p0, p1, costate = kind.sym("p0", n_p), kind.sym("p1", n_p), kind.sym("costate", nx)
        begin = kind.sym("begin", 2 * nx)

        law = _control_of_time(conditions)

        def rate(y: Any, s: Any) -> Any:  # SX or MX, as the control is closed or implicit
            """d(x, cost, z)/ds; the control is that of z, not of x."""
            at, p = t + s * h, interpolate(p0, p1, s)
            u, flow = law(y[nx + 1 :], at, p)
            plant = (functions.rate(y[:nx], u, at, p), functions.running_cost(y[:nx], u, at, p))
            return h * ca.vertcat(*plant, flow)

        end = RK4()(rate, ca.vertcat(x, 0, begin), 0.0, 1.0)
        x_next, cost, z_next = end[:nx], end[nx], end[nx + 1 :]
        u_start = conditions.control(begin[:nx], begin[nx:], t, p0)
        u_end = conditions.control(z_next[:nx], z_next[nx:], t + h, p1)
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
        return cls(ChunkedRollout(step, carried=2), ChunkedRollout(adjoint_step))

    def integrate(self, solution: Solution, steps: Steps, start: np.ndarray) -> Integrated:
        """Run states and costates beside the plant."""
        node = np.searchsorted(solution.fractions, steps.fractions[:-1] + 1e-12, side="right") - 1
        restart = np.append(True, np.diff(node) > 0).astype(float)[:, None]
        z_node = np.hstack([solution.x, solution.costate])[node]
        inputs = [restart, z_node, *steps.columns]
        x, _, costs, inner, u_start, u_end = self.step([start, z_node[0]], inputs)
        return Integrated(np.vstack([start, x]), float(costs.sum()), u_start, u_end, (inner,))


def integrator_of(solution: Solution) -> ControlIntegrator:
    """Return what integrates the controls of a solution."""
    match solution.control_kind:
        case "held":
            return _held(solution.problem)
        case "linear":
            return _linear(solution.problem)
        case "polynomial":
            return _polynomial(solution.problem)
        case "extremal":
            return _extremal(solution.problem)


_held = once_per_problem(HeldControls.of)
_linear = once_per_problem(LinearControls.of)
_polynomial = once_per_problem(PolynomialControls.of)
_extremal = once_per_problem(ExtremalControls.of)


def _control_of_time(conditions: MinimumPrinciple) -> ca.Function:
    """(z, t, p) -> the minimising control and dz/dt, through which no derivative passes.

    What is applied is a function of time; and where the control is an implicit root that was
    not found, its derivative does not exist.
    """
    flow = conditions.flow
    z, t, p = inputs = [
        symbol_type(flow).sym(flow.name_in(i), flow.sparsity_in(i)) for i in range(3)
    ]
    nx = z.numel() // 2
    outputs = [conditions.control(z[:nx], z[nx:], t, p), flow(*inputs)]
    return ca.Function("law", inputs, outputs, {"is_diff_in": [False] * 3})
