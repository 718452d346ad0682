"""What is recorded while a loop runs."""

from dataclasses import dataclass, field

import numpy as np

from ocp.closed_loop.decision import Decision
from ocp.closed_loop.plant import RunningPlant
from ocp.closed_loop.rollout import Rollout
from ocp.problem.ocp import OCP


@dataclass(eq=False)
class Journal:
    """The lists that a rollout is made of.

    Attributes:
        ocp: the problem that the plant is.
        running: the plant.
        late: intervals from a decision to its effect.
        t: sampling instants so far [s], one more than steps.
        x: true states there.
        measured: what the controller was told at each step.
        inputs: what acted in each interval.
        decisions: one a step.
        costs: of each interval.
        violation: the largest one so far.
        worst: which, and when.
        ended: why the loop ended early; empty if it did not.
    """

    ocp: OCP
    running: RunningPlant
    late: int
    t: list[float]
    x: list[np.ndarray]
    measured: list[np.ndarray] = field(default_factory=list)
    inputs: list[np.ndarray] = field(default_factory=list)
    decisions: list[Decision] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)
    violation: float = 0.0
    worst: str = ""
    ended: str = ""

    @classmethod
    def begun(cls, ocp: OCP, running: RunningPlant, late: int) -> "Journal":
        """Return the journal of a loop before its first step."""
        return cls(ocp, running, late, [running.t], [running.x])

    def advance(self, told: np.ndarray, decision: Decision, acting: np.ndarray, dt: float) -> None:
        """Apply an input for an interval, and record it."""
        cost, excess, worst = self.running.advance(acting, dt)
        if excess > self.violation:
            self.violation, self.worst = excess, worst
        self.measured.append(np.array(told))
        self.inputs.append(acting)
        self.decisions.append(decision)
        self.costs.append(cost)
        self.t.append(self.running.t)
        self.x.append(self.running.x)

    def rollout(self) -> Rollout:
        """Return what was recorded."""
        steps = len(self.x) - 1  # of a step that was interrupted some lists may have an entry more
        for entries in (self.measured, self.inputs, self.decisions, self.costs):
            del entries[steps:]
        t, x = np.array(self.t[: steps + 1]), np.array(self.x)
        m = self.ocp.model
        return Rollout(
            plant=self.ocp,
            t=t,
            x=x,
            measured=np.array(self.measured).reshape(steps, m.nx),
            inputs=np.array(self.inputs).reshape(steps, m.nu),
            sources=tuple(d.source for d in self.decisions),
            messages=tuple(d.message for d in self.decisions),
            costs=np.array(self.costs),
            violation=self.violation,
            violations=self.running.violations,
            worst=self.worst,
            drift=_drift(self.ocp, t, x),
            step_times=np.array([d.time_used for d in self.decisions]),
            clipped=np.array([d.clipped for d in self.decisions]),
            ended=self.ended,
            decisions=tuple(self.decisions),
            late=self.late,
        )


def _drift(ocp: OCP, t: np.ndarray, x: np.ndarray) -> float:
    """Largest violation of the invariants; their parameters are the declared ones."""
    if not ocp.invariants:
        return 0.0
    p = ocp.parameter_values().at(0.0)[0]
    rows = np.array([ocp.functions.invariants(*row, p) for row in zip(x, t, strict=True)])
    return float(ocp.rows.invariants.excess(rows.reshape(len(t), -1)).max(initial=0.0))
