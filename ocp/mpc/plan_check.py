"""What a plan would do from now on: run the model under it, and check the constraints."""

from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite

import numpy as np

from ocp.closed_loop.model_rollout import IntervalParameters, ModelRollout
from ocp.closed_loop.shifted_plan import plan_controls
from ocp.mpc.step_inputs import StepInputs
from ocp.problem.ocp import OCP
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
_ROUNDING = 1e-6
_NO_PARAMETERS = np.empty(0)


@dataclass(frozen=True, eq=False)
class PlanCheck:
    """The controller's model, run ahead.

    Attributes:
        ocp: the problem.
        dt: sampling interval [s].
        compiled: whether the model runs as machine code.
    """

    ocp: OCP
    dt: float
    compiled: bool
    _rehearsals: dict[int, ModelRollout] = field(default_factory=dict)

    def excess(self, plan: Solution, moment: StepInputs) -> tuple[float, str]:
        """Return by how much a new plan violates the constraints; inf where it is none."""
        if plan.status.is_success:
            if not self._is_constrained:
                return 0.0, ""
            u, ends = plan_controls(plan, plan.t[:-1]), self._ends(moment, plan.t)
            return self._rehearsal(len(u)).excess(plan.x, u, plan.t, ends)
        if plan.status not in _USABLE:
            return np.inf, plan.status.value
        return self.remaining(plan, moment)

    def remaining(self, plan: Solution, moment: StepInputs) -> tuple[float, str]:
        """Run the model from now under what is left of a plan, and check the constraints.

        Those of the end are asked of a whole plan only: a remainder ends before its horizon.
        """
        times = moment.at + plan.t - plan.t[0]
        left = int((times[:-1] < plan.t[-1] - _ROUNDING * self.dt).sum())
        if not left:
            return np.inf, "nothing is left of it"
        times = times[: left + 1]
        u, rehearsal = plan_controls(plan, times[:-1]), self._rehearsal(left)
        trial = rehearsal.of(moment.start, u, times, self._ends(moment, times))
        found = trial.excess, trial.worst
        if left < len(plan.t) - 1 or not isfinite(trial.excess):
            return found
        p = self.parameters(moment, times[-1])
        return max(found, rehearsal.end_excess(trial.x[-1], times[-1], p))

    def advanced(self, x: np.ndarray, u: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
        """Return the state one interval after t [s] under a control, parameters held."""
        times, ends = np.array([t, t + self.dt]), (p[None, :], p[None, :])
        return self._rehearsal(1).of(x, u[None, :], times, ends).x[-1]

    def parameters(self, moment: StepInputs, t: float) -> np.ndarray:
        """Return the parameters at an instant (n_p,)."""
        if not self.ocp.parameters:
            return _NO_PARAMETERS
        return moment.values.at((t - moment.since) / self.ocp.duration)[0]

    def _ends(self, moment: StepInputs, times: np.ndarray) -> IntervalParameters:
        """Return the parameters at both ends of the intervals between some instants (N + 1,)."""
        return moment.values.on((times - moment.since) / self.ocp.duration)

    def _rehearsal(self, n: int) -> ModelRollout:
        """Roll-outs over n intervals, prepared once for each n."""
        if n not in self._rehearsals:
            self._rehearsals[n] = ModelRollout(self.ocp, n, self.compiled)
        return self._rehearsals[n]

    @cached_property
    def _is_constrained(self) -> bool:
        """Whether there is anything along the way that a plan could violate."""
        ocp = self.ocp
        return bool(ocp.at("path")) or ocp.state_bounds.is_active or ocp.control_bounds.is_active
