"""What a plan says of the time ahead, and whether its controls are what a plant receives."""

import numpy as np

from ocp.loop_plotting.loop_record import LoopRecord, PlannedInput
from ocp.solution.shifted_plan import plan_controls
from ocp.solution.solution import Solution

# An input is the control of its plan if it lies between its values in the interval, up to this.
_SAME = 1e-4
_INSTANTS = 5


def plans_of(rollout: LoopRecord) -> list[Solution]:
    """Return the plans that inputs came from."""
    return [d.plan for d in rollout.decisions if d.plan is not None]


def _left(plan: Solution, t: float) -> np.ndarray:
    """Return t and the nodes of a plan after it; none where it is over."""
    first = max(t, plan.t[0])
    return np.append(first, plan.t[plan.t > first]) if first < plan.t[-1] else np.empty(0)


def states_ahead(plan: Solution, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Return instants and states of what is left of a plan from t [s] on."""
    times = _left(plan, t)
    columns = [np.interp(times, plan.t, column) for column in plan.x.T]
    return times, np.stack(columns, axis=1)


def controls_ahead(plan: Solution, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Return instants and controls of what is left of a plan from t [s] on."""
    times, nu = _left(plan, t), plan.problem.model.nu
    return times, np.array([plan_controls(plan, at) for at in times]).reshape(len(times), nu)


def sends_controls(rollout: LoopRecord) -> bool:
    """Whether what is sent are the controls of the plans, not the rates of their states."""
    followed = [(d, d.plan) for d in rollout.decisions if d.plan is not None]
    dt = float(np.diff(rollout.t).max())
    return all(_is_control(decision, plan, dt) for decision, plan in followed)


def _is_control(decision: PlannedInput, plan: Solution, dt: float) -> bool:
    span = decision.applies_at + np.linspace(0.0, dt, _INSTANTS)
    near = np.array([plan_controls(plan, float(t)) for t in span])
    if near.shape[1] != len(decision.input):
        return False
    slack = _SAME * (1.0 + np.abs(near).max()) + decision.clipped
    low, high = near.min(axis=0) - slack, near.max(axis=0) + slack
    return bool(((low <= decision.input) & (decision.input <= high)).all())
