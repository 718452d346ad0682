"""What a plan would do from now on: run the model under it, and check the constraints."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isfinite
from typing import NamedTuple

import numpy as np

from ocp.closed_loop.model_rollout import IntervalParameters, ModelRollout
from ocp.problem.constraint_rows import ImposedRows
from ocp.problem.fingerprint import differing, fingerprint
from ocp.problem.ocp import OCP
from ocp.problem.parameters import ParameterValues
from ocp.problem.scaled import sizes_of
from ocp.solution.control_rate import limited_rates
from ocp.solution.shifted_plan import plan_controls
from ocp.solution.solution import Solution
from ocp.solution.status import Status

# Not converged, but with a trajectory that may be worth applying.
_USABLE = frozenset(
    {
        Status.MYOPIC,
        Status.SMALL_DECREASE,
        Status.COST_ROSE,
        Status.ITERATION_LIMIT,
        Status.TIME_LIMIT,
        Status.NO_PROGRESS,
        # A measured state may violate what from the next node on can be met.
        Status.INFEASIBLE,
    }
)
# Of an instant, relative to the interval: later than the end by less is the end.
ROUNDING = 1e-6
# States that differ from those of linear dynamics by more than this share, of sizes and magnitudes,
# were not predicted by them.
_BENT = 0.02
_NO_PARAMETERS = np.empty(0)


class HorizonParameters(NamedTuple):
    """Parameters and signals of one horizon, read at absolute times.

    Attributes:
        values: the numbers.
        by_name: the same, as a solver takes them.
        start: of the horizon [s].
        duration: of the horizon [s].
    """

    values: ParameterValues
    by_name: Mapping[str, np.ndarray]
    start: float
    duration: float

    def at(self, t: float) -> np.ndarray:
        """Return all of them at t [s], stacked (n_p,)."""
        if not self.values.entries:
            return _NO_PARAMETERS
        return self.values.at((t - self.start) / self.duration)[0]

    def between(self, times: np.ndarray) -> IntervalParameters:
        """Return those at both ends of the intervals between instants (N + 1,) [s]."""
        if not self.values.entries:  # where it is on the horizon does not matter
            return self.values.on(times)
        return self.values.on((times - self.start) / self.duration)


class PlanViolation(NamedTuple):
    """What a plan violates when the model runs under it.

    Attributes:
        of_inputs: the largest excess of a row that limits the input, at the solver's nodes.
        largest: of any row, those of the end included.
        worst: which, and when.
    """

    of_inputs: float
    largest: float
    worst: str


@dataclass(frozen=True, eq=False)
class PlanCheck:
    """The controller's model, run ahead.

    Attributes:
        ocp: the problem.
        dt: sampling interval [s].
        compiled: whether the model runs as machine code.
        imposed: what a plan must meet: the rows that its solver was given, where it was.
    """

    ocp: OCP
    dt: float
    compiled: bool
    imposed: ImposedRows
    # By the number of intervals: a roll-out is prepared once for each.
    _rollouts: dict[int, ModelRollout] = field(default_factory=dict)
    _own_rollouts: dict[int, ModelRollout] = field(default_factory=dict)
    _input_rollouts: dict[int, ModelRollout] = field(default_factory=dict)

    def new_plan(
        self, plan: Solution, start: np.ndarray, t: float, p: HorizonParameters
    ) -> tuple[float, str]:
        """Return by how much a plan from a state ``start`` at t [s] violates the constraints.

        A converged plan is checked as it is; another one by running the model under its controls.
        Infinite where the solver's status says that there is no plan.
        """
        if foreign := self._foreign(plan, start, t):
            return np.inf, foreign
        if plan.status.is_success:
            if not self._is_constrained:
                return 0.0, ""
            u = plan.u if plan.control_kind == "held" else plan_controls(plan, plan.t[:-1])
            found = self._own_rollout(len(u)).excess(plan.x, u, plan.t, p.between(plan.t))
            return max(found, self._of_rates(plan))
        if plan.status not in _USABLE:
            return np.inf, plan.status.value
        return max(self.remainder(plan, start, t, p), self._of_rates(plan))

    def corrected_plan(
        self, plan: Solution, start: np.ndarray, t: float, p: HorizonParameters
    ) -> tuple[float, str]:
        """Return the same of a plan that a correction has made: its dynamics are linear.

        Infinite where the model, run under its controls, leaves its states: then they are no
        optimum, of whatever cost.
        """
        if foreign := self._foreign(plan, start, t):
            return np.inf, foreign
        u, between = plan_controls(plan, plan.t[:-1]), p.between(plan.t)
        model = self._rollout(len(u))
        result = model.of(start, u, plan.t, between)
        if not isfinite(result.excess):
            return np.inf, result.worst
        reached = result.x
        if plan.control_kind != "held":  # its average is nearer to a ramp than where that begins
            middles = 0.5 * (plan.t[:-1] + plan.t[1:])
            reached = model.of(start, plan_controls(plan, middles), plan.t, between).x
        if (np.abs(reached - plan.x) > _BENT * (self._sizes + np.abs(plan.x))).any():
            return np.inf, "the model leaves the states of linear dynamics"
        end = model.end_excess(result.x[-1], plan.t[-1], p.at(plan.t[-1]))
        return max((result.excess, result.worst), end, self._of_rates(plan))

    def violation(
        self, plan: Solution, start: np.ndarray, t: float, p: HorizonParameters
    ) -> PlanViolation:
        """Run the model under a plan that need not meet the constraints on states.

        Infinite where there is no plan that is worth applying.
        """
        if foreign := self._foreign(plan, start, t):
            return PlanViolation(np.inf, np.inf, foreign)
        if not plan.status.is_success and plan.status not in _USABLE:
            return PlanViolation(np.inf, np.inf, plan.status.value)
        u, between = plan_controls(plan, plan.t[:-1]), p.between(plan.t)
        model = self._rollout(len(u))
        result = model.of(start, u, plan.t, between)
        if not isfinite(result.excess):
            return PlanViolation(np.inf, np.inf, result.worst)
        found = self._input_rollout(len(u)).excess(result.x, u, plan.t, between)
        inputs = max(found, self._of_rates(plan))
        end = model.end_excess(result.x[-1], plan.t[-1], p.at(plan.t[-1]))
        return PlanViolation(inputs[0], *max((result.excess, result.worst), inputs, end))

    def _of_rates(self, plan: Solution) -> tuple[float, str]:
        """Return the largest violation of a bound of a rate by a plan, and its name."""
        rows = self.imposed.rows.rates
        if not rows.is_imposed:
            return 0.0, ""
        sizes = self.imposed.sizes and self.imposed.sizes.controls[self.ocp.control_rates.index]
        found = rows.largest_violation(*limited_rates(plan, plan.t), sizes=sizes)
        return found.relative, str(found)

    def _foreign(self, plan: Solution, start: np.ndarray, t: float) -> str:
        """Return in what a solver's answer is not one to the question; empty where it is."""
        if plan.problem is not self.ocp and self._differs(plan.problem):
            return "the plan is one of another problem"
        # Plain numbers: quicker than those of numpy, and each control step looks at them.
        first, length, rounding = plan.t.item(0), self._duration, ROUNDING * self.dt
        if abs(first - t) > rounding:
            return f"the plan begins at {first:.6g} s, not at {t:.6g} s"
        if abs(plan.t.item(-1) - first - length) > rounding:
            return f"the plan is {plan.duration:.6g} s long, not {length:.6g} s"
        begun, asked = plan.x[0].tolist(), start.tolist()
        if begun != asked and not _are_near(begun, asked):
            return f"the plan begins at {plan.x[0]}, not at {start}"
        return ""

    def remainder(
        self,
        plan: Solution,
        start: np.ndarray,
        t: float,
        p: HorizonParameters,
        *,
        to_its_end: bool = True,
    ) -> tuple[float, str]:
        """Run the model from t [s] under what is left of a plan, and check the constraints.

        Those of the end hold at the plan's own end, which a push of the state may have moved away.

        Args:
            plan: made at t or before.
            start: state then (nx,).
            t: [s].
            p: of the horizon.
            to_its_end: whether those of the end are checked.
        """
        later = plan.t[plan.t > t + ROUNDING * self.dt]
        left = len(later)
        if not left:
            return np.inf, "nothing is left of it"
        times = np.append(t, later)
        u, model = plan_controls(plan, times[:-1]), self._rollout(left)
        result = model.of(start, u, times, p.between(times))
        found = result.excess, result.worst
        if not isfinite(result.excess) or not to_its_end:
            return found
        return max(found, model.end_excess(result.x[-1], times[-1], p.at(times[-1])))

    def next_state(self, x: np.ndarray, u: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
        """Return the state one interval after t [s] under a control, parameters held."""
        times, ends = np.array([t, t + self.dt]), (p[None, :], p[None, :])
        return self._rollout(1).of(x, u[None, :], times, ends).x[-1]

    def _rollout(self, n: int) -> ModelRollout:
        """Return a roll-out that checks the rows at all nodes."""
        if n not in self._rollouts:
            imposed = ImposedRows(self.imposed.rows, sizes=self.imposed.sizes)
            self._rollouts[n] = ModelRollout(self.ocp, n, self.compiled, imposed=imposed)
        return self._rollouts[n]

    def _own_rollout(self, n: int) -> ModelRollout:
        """Return one that checks a solver's own nodes."""
        if n not in self._own_rollouts:
            self._own_rollouts[n] = replace(self._rollout(n), imposed=self.imposed)
        return self._own_rollouts[n]

    def _input_rollout(self, n: int) -> ModelRollout:
        """Return one that checks the limits of the input alone, at a solver's own nodes."""
        if n not in self._input_rollouts:
            imposed = replace(self.imposed, rows=self.ocp.rows.softened())
            self._input_rollouts[n] = replace(self._rollout(n), imposed=imposed)
        return self._input_rollouts[n]

    def _differs(self, problem: OCP) -> bool:
        return bool(differing(fingerprint(problem), fingerprint(self.ocp)))

    @cached_property
    def _duration(self) -> float:
        return self.ocp.duration

    @cached_property
    def _sizes(self) -> np.ndarray:
        return sizes_of(self.ocp).x

    @cached_property
    def _is_constrained(self) -> bool:
        """Whether there is anything along the way that a plan could violate."""
        rows = self.imposed.rows
        parts = (rows.path, rows.states, rows.controls, rows.rates)
        return any(part.is_imposed for part in parts)


def _are_near(begun: list[float], asked: list[float]) -> bool:
    """Whether a plan's first state is the one that was asked for, but for rounding."""
    each = zip(begun, asked, strict=True)
    return all(abs(there - here) <= ROUNDING * (1.0 + abs(here)) for there, here in each)
