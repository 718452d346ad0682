"""Integrate the controls of a solution by SUNDIALS' CVODES, where explicit steps do not pay.

Source: [Hindmarsh et al. 2005], as CasADi brings it: variable-order backward differentiation
formulas, with a new start wherever controls or signals may jump.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ocp.integration.one_step import interpolate
from ocp.minimum_principle.necessary_conditions import symbol_type
from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.referee.control_integrators import Integrated, Restarts, Steps
from ocp.referee.extremal_law import extremal_law, extremal_of
from ocp.solution.solution import Solution

# No step is longer than this fraction of an interval (an odd one: no wave is in step with it),
# nor are there more steps in it; over the horizon they take a few seconds.
_LONGEST_STEP = 0.0437
_MOST_STEPS = 20_000
_MOST_STEPS_OF_ALL = 600_000
# What CVODES says of them, or of the cost, where they raise an exception.
_OF_THE_DYNAMICS = "RHSFUNC_FAIL"


@dataclass(frozen=True, eq=False)
class _Pieces:
    """The integrators of a problem, by kind of control, samples an interval, tolerance, limit."""

    ocp: OCP
    built: dict[tuple[int, int, float, int], ca.Function] = field(default_factory=dict)

    def of(self, count: int, samples: int, tolerance: float, most_steps: int) -> ca.Function:
        """Return the integrator over one interval; a count of 0 means an extremal."""
        key = (count, samples, tolerance, most_steps)
        if key not in self.built:
            self.built[key] = _piece(self.ocp, *key)
        return self.built[key]


_pieces = once_per_problem(_Pieces)


def integrate_implicitly(
    solution: Solution,
    steps: Steps,
    substeps: int,
    start: np.ndarray,
    restarts: Restarts | None,
    tolerance: float,
) -> Integrated:
    """Apply the controls of a solution, of any kind, from a start (nx,) or by segments.

    Args:
        solution: its controls.
        steps: where the result is wanted, ``substeps`` equal ones in every interval between
            two knots.
        substeps: how many.
        start: first state (nx,).
        restarts: where segments begin.
        tolerance: of the error in each step of the method, relative to the size of each state
            along the solution and of the running cost.

    Returns:
        NaN from the first interval that cannot be integrated.
    """
    is_extremal = solution.control_kind == "extremal"
    control = _Extremal(solution) if is_extremal else _Known(solution)
    t, nx = steps.t[::substeps], solution.problem.model.nx
    drive = control.drive(t)
    most_steps = min(_MOST_STEPS, _MOST_STEPS_OF_ALL // len(drive))
    piece = _pieces(solution.problem).of(control.count, substeps, tolerance, most_steps)
    ends = np.full((len(steps.p_start), control.width), np.nan)
    x, costs = np.full((len(ends) + 1, control.width), np.nan), np.full(len(ends), np.nan)
    w, size, cost_size = control.begin(start, t[0]), control.sizes, _cost_size(solution)
    for k in range(len(t) - 1):
        i = slice(k * substeps, (k + 1) * substeps)
        if restarts is not None and restarts.flags[i.start, 0] > 0.5:
            w = np.concatenate([restarts.x[i.start], w[nx:]])
        w = control.restarted(w, t[k])
        parameters = steps.p_start[i.start], steps.p_end[i.stop - 1]
        data = np.hstack([size, cost_size, t[k], t[k + 1] - t[k], *parameters, drive[k]])
        found = _integrated(piece, w / size, data)
        if found is None:
            break
        ends[i] = size * np.array(found["xf"]).T
        costs[i] = cost_size * np.diff(np.array(found["qf"]).ravel(), prepend=0.0)
        x[i] = np.vstack([w, ends[i][:-1]])
        w = ends[i.stop - 1]
    x[-1] = ends[-1]
    u_start, u_end = control.along(steps, substeps, drive, x[:-1], ends)
    return Integrated(x[:, :nx], ends[:, :nx], costs, u_start, u_end, ())


def _integrated(piece: ca.Function, x0: np.ndarray, p: np.ndarray) -> dict[str, ca.DM] | None:
    """Return xf and qf of one interval; None where CVODES fails.

    Raises:
        KeyboardInterrupt: Ctrl-C, which CVODES takes for a failure of the dynamics; that failure
            is the one which does not repeat.
    """
    # Called by itself: inside another Function CasADi prints the inputs of a failure.
    try:
        return piece(x0=x0, p=p)
    except RuntimeError as error:  # what CasADi raises for every failure of CVODES
        if _OF_THE_DYNAMICS not in str(error):
            return None
    try:
        piece(x0=x0, p=p)
    except RuntimeError:
        return None
    raise KeyboardInterrupt


@dataclass(frozen=True, eq=False)
class _Known:
    """Controls that are polynomials in every interval, by their values at instants of it."""

    solution: Solution

    @property
    def count(self) -> int:
        """How many values determine the polynomial."""
        held, linear = 1, 2
        if self.solution.control_kind == "polynomial":
            return max(linear, self.solution.pieces.coefficients.shape[1])
        return held if self.solution.control_kind == "held" else linear

    @property
    def width(self) -> int:
        """How many numbers are integrated."""
        return self.solution.problem.model.nx

    @property
    def sizes(self) -> np.ndarray:
        """Their sizes."""
        return _sizes(self.solution.x)

    def begin(self, start: np.ndarray, t: float) -> np.ndarray:
        """Return them at the start."""
        return start

    def restarted(self, w: np.ndarray, t: float) -> np.ndarray:
        """Return them at a knot."""
        return w

    def drive(self, t: np.ndarray) -> np.ndarray:
        """Return the values in each interval between knots t, (N, count nu)."""
        solution, middle = self.solution, (t[1:] + t[:-1]) / 2
        if solution.control_kind == "held":
            return solution.control(middle)
        at = [t[:-1] + s * np.diff(t) for s in _abscissae(self.count)]
        if solution.control_kind == "polynomial":
            piece = solution.pieces.of(middle)
            return np.hstack([solution.pieces.at(instants, piece) for instants in at])
        return np.hstack([solution.control(instants) for instants in at])

    def along(
        self, steps: Steps, substeps: int, drive: np.ndarray, x: np.ndarray, ends: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the controls at both ends of every step, (K, nu) each."""
        values = drive.reshape(len(drive), self.count, -1)
        s = np.arange(substeps + 1) / substeps
        weights = np.stack([_lagrange(self.count, j, s) + 0.0 * s for j in range(self.count)], 1)
        u = np.einsum("sj,kju->ksu", weights, values)
        return u[:, :-1].reshape(len(x), -1), u[:, 1:].reshape(len(x), -1)


@dataclass(frozen=True, eq=False)
class _Extremal:
    """The minimising control along states and costates that begin again at every node."""

    solution: Solution
    count: int = 0

    @property
    def width(self) -> int:
        """How many numbers are integrated: the plant, and states and costates beside it."""
        return self.solution.problem.model.nx + 2 * self._extremal.problem.model.nx

    @property
    def sizes(self) -> np.ndarray:
        """Their sizes."""
        parts = self.solution.x, self._extremal.x, self._extremal.costate
        return np.concatenate([_sizes(part) for part in parts])

    def begin(self, start: np.ndarray, t: float) -> np.ndarray:
        """Return them at the start."""
        return np.concatenate([start, self._extremal.x[0], self._extremal.costate[0]])

    def restarted(self, w: np.ndarray, t: float) -> np.ndarray:
        """Return them at a knot: at a node, states and costates are the solution's."""
        nodes, nx = self.solution.t, self.solution.problem.model.nx
        k = int(np.abs(nodes - t).argmin())
        if abs(nodes[k] - t) > 1e-12 * self.solution.duration:
            return w
        return np.concatenate([w[:nx], self._extremal.x[k], self._extremal.costate[k]])

    def drive(self, t: np.ndarray) -> np.ndarray:
        """Return nothing for each interval."""
        return np.empty((len(t) - 1, 0))

    def along(
        self, steps: Steps, substeps: int, drive: np.ndarray, x: np.ndarray, ends: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the controls at both ends of every step, (K, nu) each."""
        nx = self.solution.problem.model.nx
        law = extremal_law(self.solution.problem).control.map(len(ends))
        sides = ((x, steps.t[:-1], steps.p_start), (ends, steps.t[1:], steps.p_end))
        u_start, u_end = (np.array(law(w[:, nx:].T, t[None, :], p.T)).T for w, t, p in sides)
        return u_start, u_end

    @cached_property
    def _extremal(self) -> Solution:
        return extremal_of(self.solution)


def _piece(ocp: OCP, count: int, samples: int, tolerance: float, most_steps: int) -> ca.Function:
    """(x0, p) -> xf, qf: states and running cost at samples of one interval, by their sizes."""
    rate = _extremal_rate(ocp) if count == 0 else _known_rate(ocp, count)
    kind = symbol_type(rate)
    width, n_data = rate.size1_in(0), rate.size1_in(2)
    w, s, size = kind.sym("w", width), kind.sym("s"), kind.sym("size", width)
    cost_size, data = kind.sym("cost_size"), kind.sym("data", n_data)
    dw, cost = rate(size * w, s, data)
    p = ca.vertcat(size, cost_size, data)
    dae = {"x": w, "t": s, "p": p, "ode": dw / size, "quad": cost / cost_size}
    options = {
        "reltol": tolerance,
        "abstol": tolerance,
        "quad_err_con": True,
        "max_step_size": _LONGEST_STEP,
        "max_num_steps": most_steps,
        "disable_internal_warnings": True,
        "show_eval_warnings": False,
    }
    grid = (np.arange(1, samples + 1) / samples).tolist()
    return ca.integrator("piece", "cvodes", dae, 0.0, grid, options)


def _known_rate(ocp: OCP, count: int) -> ca.Function:
    """(x, s, data) -> h f and h L, data = (t, h, p0, p1, values of the control)."""
    m, n_p, f = ocp.model, ocp.p.numel(), ocp.functions
    x, s, t, h = ca.SX.sym("x", m.nx), ca.SX.sym("s"), ca.SX.sym("t"), ca.SX.sym("h")
    p0, p1, u = ca.SX.sym("p0", n_p), ca.SX.sym("p1", n_p), ca.SX.sym("u", m.nu * count)
    values = ca.reshape(u, m.nu, count)
    control = sum(
        (_lagrange(count, j, s) * values[:, j] for j in range(count)), start=ca.SX.zeros(m.nu)
    )
    now = (x, control, t + s * h, interpolate(p0, p1, s))
    data = ca.vertcat(t, h, p0, p1, u)
    return ca.Function("rate", [x, s, data], [h * f.rate(*now), h * f.running_cost(*now)])


def _extremal_rate(ocp: OCP) -> ca.Function:
    """(plant, state, costate; s; data) -> h times their rates and h L, data = (t, h, p0, p1)."""
    known, functions, nx, n_p = extremal_law(ocp), ocp.functions, ocp.model.nx, ocp.p.numel()
    kind = symbol_type(known.flow)
    w, s = kind.sym("w", nx + known.flow.size1_in(0)), kind.sym("s")
    t, h = kind.sym("t"), kind.sym("h")
    p0, p1 = kind.sym("p0", n_p), kind.sym("p1", n_p)
    at, p = t + s * h, interpolate(p0, p1, s)
    now = (w[:nx], known.control(w[nx:], at, p), at, p)
    flow = known.flow(w[nx:], at, p)
    cost = functions.running_cost(*now) + known.price(w[nx:], at, p)
    rates = [h * ca.vertcat(functions.rate(*now), flow), h * cost]
    return ca.Function("rate", [w, s, ca.vertcat(t, h, p0, p1)], rates)


def _abscissae(count: int) -> np.ndarray:
    """Where in an interval the values of a control are taken, 0 to 1."""
    return np.linspace(0.0, 1.0, count)


def _lagrange(count: int, j: int, s: Any) -> Any:  # an array or a symbol
    """Return the j-th Lagrange polynomial of the abscissae at s."""
    nodes, value = _abscissae(count), 1.0
    for i in range(count):
        if i != j:
            value = value * (s - nodes[i]) / (nodes[j] - nodes[i])
    return value


def _sizes(values: np.ndarray) -> np.ndarray:
    """Return the largest magnitude of each column; of the smallest ones, a part of the others'."""
    most = np.abs(values).max(axis=0)
    return np.maximum(most, 1e-6 * most.max(initial=0.0) or 1.0)


def _cost_size(solution: Solution) -> float:
    """Return the running cost of the solution's own states, in magnitude over the horizon."""
    ocp, t = solution.problem, solution.t[:-1]
    along = ocp.functions.running_cost.map(len(t))
    p = solution.data.values.at(solution.fractions[:-1])
    values = np.array(along(solution.x[:-1].T, solution.control(t).T, t[None, :], p.T))
    size = float(np.abs(values).mean() * solution.duration)
    return size if np.isfinite(size) and size > 0.0 else 1.0
