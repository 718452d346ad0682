"""What a computing delay costs, with and without compensation.

The arm rests before its task begins, and the controllers know from where it will begin: their
first input is there in time. What is lost after that is lost to the delay.
"""

from benchmarks.cases import arm_scenario
from benchmarks.mpc.arm_loop import DT, controller, plant, problem
from ocp import Rollout, closed_loop

DELAY = 2 * DT


def delayed_loops(name: str, horizon: float, delay: float = DELAY) -> dict[str, Rollout]:
    """Return the loops around the direct method: prompt, compensated and not compensated."""
    scenario = arm_scenario(name)
    ocp, truth = problem(scenario, horizon), plant(scenario)
    controllers = {
        "no delay": controller("direct", ocp),
        "compensated": controller("direct", ocp, delay=delay),
        "not compensated": controller("direct", ocp, delay=delay, compensate=False),
    }
    duration = DT * round(scenario.horizon / DT)
    return {
        what: closed_loop(each, truth, scenario.theta0, duration, dt=DT, head_start=True)
        for what, each in controllers.items()
    }
