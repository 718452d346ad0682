"""Integrate the controls of a solution on a given grid: a class for each kind of control."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from ocp.integration.one_step import RK4, Stage, interpolate
from ocp.minimum_principle.necessary_conditions import symbol_type
from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.referee.chunked_rollout import ChunkedRollout
from ocp.referee.extremal_law import ExtremalLaw, extremal_law, extremal_of
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


class Restarts(NamedTuple):
    """Where an integration by segments begins again, and from which states.

    Attributes:
        flags: 1 at the steps that begin a segment, else 0, (K, 1).
        x: the states there; anything elsewhere, (K, nx).
    """

    flags: np.ndarray
    x: np.ndarray


class Integrated(NamedTuple):
    """What controls do on a grid of K steps.

    Attributes:
        x: states at the start of each step and at the end, (K + 1, nx).
        ends: states after each step, (K, nx); ``x[1:]``, but where a segment begins.
        costs: running cost of each step, (K,).
        u_start: control at the start of each step, (K, nu).
        u_end: control at the end of each step (its limit from the left), (K, nu).
        drive: what determines the control in each step, as the adjoint takes it.
    """

    x: np.ndarray
    ends: np.ndarray
    costs: np.ndarray
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
    def integrate(
        self, solution: Solution, steps: Steps, start: np.ndarray, restarts: Restarts | None = None
    ) -> Integrated:
        """Apply the controls of a solution from a start (nx,), or from that of each segment."""

    def _march(
        self, start: list[np.ndarray], inputs: list[np.ndarray], restarts: Restarts | None
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return states (K + 1, nx), see ``Integrated``, and all outputs of the steps."""
        if restarts is None:
            outputs = self.step(start, inputs)
            return np.vstack([start[0], outputs[0]]), outputs
        outputs = self._restarting(start, [*restarts, *inputs])
        x = np.vstack([start[0], outputs[0]])
        x[:-1] = np.where(restarts.flags > 0.5, restarts.x, x[:-1])
        return x, outputs

    @cached_property
    def _restarting(self) -> ChunkedRollout:
        """The steps, from a given state wherever a flag says so."""
        step = self.step.step
        inputs = [ca.MX.sym(step.name_in(i), step.sparsity_in(i)) for i in range(step.n_in())]
        carried, others = inputs[: self.step.carried], inputs[self.step.carried :]
        flag, given = ca.MX.sym("flag"), ca.MX.sym("given", carried[0].numel())
        begin = ca.if_else(flag > 0.5, given, carried[0])
        outputs = step.call([begin, *carried[1:], *others])
        function = ca.Function("restarting", [*carried, flag, given, *others], outputs)
        return ChunkedRollout(function, self.step.carried)


class _KnownControls(ControlIntegrator):
    """Controls that are given functions of time."""

    def integrate(
        self, solution: Solution, steps: Steps, start: np.ndarray, restarts: Restarts | None = None
    ) -> Integrated:
        """Apply them."""
        drive = self._drive(solution, steps)
        x, (ends, costs) = self._march([start], [*drive, *steps.columns], restarts)
        return Integrated(x, ends, costs.ravel(), drive[0], drive[-1], drive)

    @abstractmethod
    def _drive(self, solution: Solution, steps: Steps) -> tuple[np.ndarray, ...]:
        """Return the controls at both ends of each step, and what lies between, (K, nu) each."""


class HeldControls(_KnownControls):
    """Controls held from node to node."""

    @classmethod
    def of(cls, ocp: OCP) -> Self:
        """Build the steps."""
        stage = Stage.of(ocp, RK4(), held=False)
        return cls(ChunkedRollout(stage.step), ChunkedRollout(stage.adjoint))

    def _drive(self, solution: Solution, steps: Steps) -> tuple[np.ndarray, ...]:
        """Hold them."""
        middle = (steps.fractions[1:] + steps.fractions[:-1]) / 2
        node = np.searchsorted(solution.fractions, middle) - 1
        u = solution.u[np.clip(node, 0, len(solution.u) - 1)]
        return u, u


class LinearControls(HeldControls):
    """Controls linear from node to node: the same steps."""

    def _drive(self, solution: Solution, steps: Steps) -> tuple[np.ndarray, ...]:
        """Interpolate them."""
        nodes = solution.fractions
        u = np.stack([np.interp(steps.fractions, nodes, c) for c in solution.u.T], axis=1)
        return u[:-1], u[1:]


class PolynomialControls(_KnownControls):
    """Polynomials from break to break: a step sees both ends and the middle exactly."""

    @classmethod
    def of(cls, ocp: OCP) -> Self:
        """Build the steps."""
        stage = Stage.of(ocp, RK4(), held=False, curved=True)
        return cls(ChunkedRollout(stage.step), ChunkedRollout(stage.adjoint))

    def _drive(self, solution: Solution, steps: Steps) -> tuple[np.ndarray, ...]:
        """Evaluate them."""
        t, pieces = solution.t[0] + steps.fractions * solution.duration, solution.pieces
        middle = (t[1:] + t[:-1]) / 2
        piece = pieces.of(middle)
        return tuple(pieces.at(at, piece) for at in (t[:-1], middle, t[1:]))


class ExtremalControls(ControlIntegrator):
    """The control minimising H along (x, costate), both restarted at the solution's nodes.

    The plant's own state runs through: the control is a function of time, as it would be
    applied, and errors of the solution are not healed at the nodes. It has no parameters, so
    the adjoint's gradients are zero.
    """

    @classmethod
    def of(cls, ocp: OCP) -> Self:
        """Build the steps."""
        known, functions, nx, n_p = extremal_law(ocp), ocp.functions, ocp.model.nx, ocp.p.numel()
        kind, width = symbol_type(known.flow), known.flow.size1_in(0)
        x, z, z_node = kind.sym("x", nx), kind.sym("z", width), kind.sym("z_node", width)
        restart, t, h = kind.sym("restart"), kind.sym("t"), kind.sym("h")
        p0, p1, costate = kind.sym("p0", n_p), kind.sym("p1", n_p), kind.sym("costate", nx)
        begin = kind.sym("begin", width)

        law = _control_of_time(known)

        def rate(y: Any, s: Any) -> Any:  # SX or MX, as the control is closed or implicit
            """d(x, cost, z)/ds; the control is that of z, not of x."""
            at, p = t + s * h, interpolate(p0, p1, s)
            u, flow, price = law(y[nx + 1 :], at, p)
            cost = functions.running_cost(y[:nx], u, at, p) + price
            return h * ca.vertcat(functions.rate(y[:nx], u, at, p), cost, flow)

        end = RK4()(rate, ca.vertcat(x, 0, begin), 0.0, 1.0)
        x_next, cost, z_next = end[:nx], end[nx], end[nx + 1 :]
        u_start, u_end = known.control(begin, t, p0), known.control(z_next, t + h, p1)
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

    def integrate(
        self, solution: Solution, steps: Steps, start: np.ndarray, restarts: Restarts | None = None
    ) -> Integrated:
        """Run states and costates beside the plant."""
        node = np.searchsorted(solution.fractions, steps.fractions[:-1] + 1e-12, side="right") - 1
        restart = np.append(True, np.diff(node) > 0).astype(float)[:, None]
        extremal = extremal_of(solution)
        z_node = np.hstack([extremal.x, extremal.costate])[node]
        inputs = [restart, z_node, *steps.columns]
        x, outputs = self._march([start, z_node[0]], inputs, restarts)
        ends, _, costs, inner, u_start, u_end = outputs
        return Integrated(x, ends, costs.ravel(), u_start, u_end, (inner,))


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


def _control_of_time(known: ExtremalLaw) -> ca.Function:
    """(z, t, p) -> minimising control, dz/dt, price of rates, through which no derivative passes.

    What is applied is a function of time; and where the control is an implicit root that was
    not found, its derivative does not exist.
    """
    flow = known.flow
    inputs = [symbol_type(flow).sym(flow.name_in(i), flow.sparsity_in(i)) for i in range(3)]
    outputs = [known.control(*inputs), flow(*inputs), known.price(*inputs)]
    return ca.Function("law", inputs, outputs, {"is_diff_in": [False] * 3})
