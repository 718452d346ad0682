"""What a computing delay costs, with and without compensation.

Until the first input arrives nothing can be done, by any controller. So the yardstick is a
loop without delay that sends nothing for as long: its cost counts the same first intervals.
"""

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.cases import arm_scenario
from benchmarks.mpc.arm_loop import DT, controller, plant, problem
from ocp import MPC, Decision, Rollout, closed_loop

DELAY = 2 * DT


@dataclass(frozen=True, eq=False)
class Waiting:
    """A controller without delay that sends zeros for a while."""

    mpc: MPC
    until: float
    delay: float = 0.0

    def reset(self) -> None:
        """Reset the MPC."""
        self.mpc.reset()

    def step(self, x: np.ndarray, t: float) -> Decision:
        """Decide, or wait."""
        decision = self.mpc.step(x, t)
        waits = t < self.until - 1e-9
        return replace(decision, input=np.zeros_like(decision.input)) if waits else decision


def delayed_loops(name: str, horizon: float, delay: float = DELAY) -> dict[str, Rollout]:
    """Return the loops around the direct method: waiting, compensated and not compensated."""
    scenario = arm_scenario(name)
    ocp, truth = problem(scenario, horizon), plant(scenario)
    controllers = {
        "no delay, late start": Waiting(controller("direct", ocp), delay),
        "compensated": controller("direct", ocp, delay=delay),
        "not compensated": controller("direct", ocp, delay=delay, compensate=False),
    }
    duration = DT * round(scenario.horizon / DT)
    return {
        what: closed_loop(each, truth, scenario.theta0, duration, dt=DT)
        for what, each in controllers.items()
    }
