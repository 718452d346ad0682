"""What a solution's controls really do: the trajectory, and one integration of it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from ocp.problem.data_residuals import data_cost, data_residuals, instant_fractions
from ocp.problem.time_switches import time_switches
from ocp.referee.control_integrators import Restarts, Steps, integrator_of
from ocp.referee.implicit_integrator import integrate_implicitly
from ocp.solution.solution import Solution

Replay = Literal["open loop", "by segments"]


# By how much the length of steps differs within an interval.
_UNEVEN = 0.25
# Of a switch by the clock, as a fraction of the horizon.
_ASIDE = 2e-9


@dataclass(frozen=True, eq=False)
class ReferenceTrajectory:
    """A solution's controls applied to its problem, on a fine grid of K steps.

    Attributes:
        t: (K + 1,) [s].
        x: at the start of every step and at the end, (K + 1, nx).
        ends: at the end of every step, (K, nx): ``x[1:]``, but for the last step of a segment.
        u_start: control at the start of each step, (K, nu).
        u_end: control at the end of each step (its limit from the left), (K, nu).
        drive: what determines the control in each step, see ``Integrated``.
        p_start: parameters at the start of each step, (K, n_p).
        p_end: parameters at the end of each step, (K, n_p).
        cost: running cost, terminal cost, and that of data.
        cost_size: integral of abs(L) plus the magnitude of the other costs.
        cost_error: bound of the error of the cost, from integrations of other accuracy; inf where
            none was made.
        end_error: by how much the last refinement moved the final state, relative.
        substeps: steps in every interval between two knots.
        replay: ``"open loop"``: from the start to the end; ``"by segments"``: from each node of
            the solution to the next, for dynamics that amplify every rounding error.
        method: ``"explicit"``: RK4, in steps that are a little uneven; ``"implicit"``: CVODES.
        escape: when the state leaves the finite numbers, if it surely does [s].
    """

    t: np.ndarray
    x: np.ndarray
    ends: np.ndarray
    u_start: np.ndarray
    u_end: np.ndarray
    drive: tuple[np.ndarray, ...]
    p_start: np.ndarray
    p_end: np.ndarray
    cost: float
    cost_size: float
    cost_error: float
    substeps: int
    end_error: float = np.inf
    replay: Replay = "open loop"
    method: Literal["explicit", "implicit"] = "explicit"
    escape: float | None = None

    @property
    def is_finite(self) -> bool:
        """Whether the integration stayed finite."""
        return bool(np.isfinite(self.cost) and np.isfinite(self.x).all())

    @property
    def has_adjoint(self) -> bool:
        """Whether ``adjoint`` can be integrated: along explicit steps in open loop."""
        return self.is_finite and self.method == "explicit" and self.replay == "open loop"

    @property
    def resolution(self) -> float:
        """The largest distance of instants at which states, rows and costs are looked at [s]."""
        return float(np.diff(self.t).max())

    def integral(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Return the integral over the horizon (m,), by Simpson's rule over pairs of steps.

        Args:
            left: values at the starts of the steps (K, m).
            right: values at their ends, limits from the left (K, m).
        """
        first, second = np.diff(self.t)[::2], np.diff(self.t)[1::2]
        both = first + second
        weights = (2.0 - second / first, both**2 / (first * second), 2.0 - first / second)
        values = (left[::2], right[::2], right[1::2])
        parts = [(w * both) @ v for w, v in zip(weights, values, strict=True)]
        return np.sum(parts, axis=0) / 6.0


@dataclass(frozen=True, eq=False)
class Replayed:
    """A solution whose controls are applied, in open loop or by segments.

    Attributes:
        solution: controls of any kind; the start is the one that was asked for, or the
            solution's own where the problem leaves it free.
        replay: whether every node of the solution begins a segment.
        moved: displacement of every segment's start (nx,).
    """

    solution: Solution
    replay: Replay = "open loop"
    moved: np.ndarray | float = 0.0

    @property
    def intervals(self) -> int:
        """The number of intervals between two knots."""
        return len(self.knots) - 1

    @cached_property
    def knots(self) -> np.ndarray:
        """Fractions of the horizon between which controls, signals and the clock are smooth."""
        solution = self.solution
        if solution.problem.model.is_discrete:
            return solution.fractions
        values = solution.data.values
        t0, duration = float(solution.t[0]), solution.duration
        instants = instant_fractions(solution.problem)
        knots = np.union1d(np.union1d(solution.fractions, values.knots), instants)
        knots = knots[np.concatenate([[True], np.diff(knots) > 1e-9])]
        switches = time_switches(solution.problem, t0, duration, values)
        # A step ends before a switch, and another begins behind it.
        around = np.concatenate([switches - _ASIDE, switches + _ASIDE])
        around = around[(around > 0.0) & (around < 1.0)]
        apart = np.abs(around[:, None] - knots).min(axis=1, initial=1.0)
        return np.union1d(knots, around[apart > 1e-9])

    @property
    def node_knots(self) -> np.ndarray:
        """Which knots are the solution's nodes, (N + 1,); nodes in one place have one knot."""
        return np.searchsorted(self.knots, self.solution.fractions, side="right") - 1

    def explicitly(self, substeps: int) -> ReferenceTrajectory:
        """Integrate by RK4; its error is not known yet."""
        return self._integrated(substeps, None)

    def implicitly(self, substeps: int, tolerance: float) -> ReferenceTrajectory:
        """Integrate by CVODES; its error is not known yet."""
        return self._integrated(substeps, tolerance)

    def _integrated(self, substeps: int, tolerance: float | None) -> ReferenceTrajectory:
        solution, ocp, knots = self.solution, self.solution.problem, self.knots
        inside = np.arange(substeps) / substeps
        if tolerance is None:
            inside = _uneven(inside)
        fine = np.append((knots[:-1, None] + inside * np.diff(knots)[:, None]).ravel(), 1.0)
        t = solution.t[0] + fine * solution.duration
        values = solution.data.values
        steps = Steps(fine, t, *values.on(fine))
        start = ocp.start_of(solution.x0, solution.x[0]) + self.moved
        restarts = self._restarts(substeps, len(t) - 1)
        if tolerance is None:
            found = integrator_of(solution).integrate(solution, steps, start, restarts)
        else:
            given = (solution, steps, substeps, start, restarts, tolerance)
            found = integrate_implicitly(*given)
        terminal = float(ocp.functions.terminal_cost(found.x[-1], t[-1], values.at(1.0)[0]))
        if ocp.data:
            before = np.vstack([found.x[:1], found.ends])

            def states(fractions: np.ndarray) -> np.ndarray:
                return before[np.abs(fine[:, None] - fractions).argmin(axis=0)]

            terminal += data_cost(data_residuals(ocp, states, float(t[0]), values))
        return ReferenceTrajectory(
            t=t,
            x=found.x,
            ends=found.ends,
            u_start=found.u_start,
            u_end=found.u_end,
            drive=found.drive,
            p_start=steps.p_start,
            p_end=steps.p_end,
            cost=float(found.costs.sum()) + terminal,
            cost_size=float(np.abs(found.costs).sum()) + abs(terminal),
            cost_error=0.0 if ocp.model.is_discrete else np.inf,
            substeps=substeps,
            replay=self.replay,
            method="explicit" if tolerance is None else "implicit",
        )

    def _restarts(self, substeps: int, count: int) -> Restarts | None:
        if self.replay == "open loop":
            return None
        first, nodes = np.unique(self.node_knots[:-1], return_index=True)
        flags, x = np.zeros((count, 1)), np.zeros((count, self.solution.x.shape[1]))
        later = nodes > 0
        at = first[later] * substeps
        flags[at], x[at] = 1.0, self.solution.x[nodes[later]] + self.moved
        return Restarts(flags, x)


def adjoint(
    solution: Solution, truth: ReferenceTrajectory, final: np.ndarray
) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Return costates (K + 1, nx), and gradients dJ/du at both ends of each step, (K, nu) each.

    Between those of the ends stands that of the middle, where the control is polynomial.
    The adjoint of the discretised trajectory itself, from ``final`` backwards: consistent
    to the order of the integrator, with no error of its own. For an extremal the gradients
    are zero: its controls have no parameters. Only where the trajectory ``has_adjoint``.
    """
    steps = np.diff(truth.t)[:, None]
    inputs = [truth.x[:-1], *truth.drive, truth.t[:-1, None], steps, truth.p_start, truth.p_end]
    backwards = [array[::-1] for array in inputs]
    costate, *gradients = integrator_of(solution).adjoint([final], backwards)
    return np.vstack([costate[::-1], final]), tuple(g[::-1] for g in gradients)


def _uneven(inside: np.ndarray) -> np.ndarray:
    """Return instants in [0, 1) that are in step with no wave: 3/4 to 5/4 as far apart as before.

    Ends and middle stay where they are.
    """
    return inside + _UNEVEN / (2.0 * np.pi) * np.sin(2.0 * np.pi * inside)
