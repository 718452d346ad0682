"""What a short horizon gains by a terminal cost."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from benchmarks.mpc.arm_loop import DT, controller, plant, problem
from models import ArmScenario
from ocp import OCP, Parameter, Rollout, solve
from solvers import MultipleShooting

# For how long at most an arm that stands still would pay what it pays at the end [s].
LINGER = 0.3
_COARSE = 30

ENDINGS = ("none", "lingering", "previous plan")


@dataclass(frozen=True, eq=False)
class Ending:
    """A problem with its terminal cost, and the parameters that this needs."""

    ocp: OCP
    parameters: Callable[[float], Mapping[str, np.ndarray]] | None = None


def ending(scenario: ArmScenario, horizon: float, kind: str) -> Ending:
    """Return the problem over one horizon with a terminal cost.

    * ``"none"``: nothing.
    * ``"lingering"``: an approximation of the cost to go: the running cost of the last
      posture without null-space motion, for the time that is left but 0.3 s at most.
    * ``"previous plan"``: psi(t)' x, the first-order term of the cost to go along one coarse
      plan (30 intervals) of the whole task that is made before the start.
    """
    ocp = problem(scenario, horizon)
    end, m = scenario.horizon, ocp.model
    if kind == "lingering":
        rest = ca.substitute(ocp.running_cost, m.u, ca.SX.zeros(m.nu))
        left = ca.fmax(0.0, ca.fmin(end - m.t, LINGER))
        return Ending(replace(ocp, terminal_cost=left * rest))
    if kind == "previous plan":
        plan = solve(problem(scenario, end), MultipleShooting(_COARSE)).or_raise()
        slope = ca.SX.sym("slope", m.nx)

        def at_end(t: float) -> Mapping[str, np.ndarray]:
            costates = [np.interp(t + horizon, plan.t, column) for column in plan.costate.T]
            return {"slope": np.array(costates)}

        with_slope = replace(
            ocp,
            terminal_cost=ca.dot(slope, m.x),
            parameters=(Parameter("slope", slope, np.zeros(m.nx)),),
        )
        return Ending(with_slope, at_end)
    return Ending(ocp)


def loop_with(scenario: ArmScenario, horizon: float, kind: str) -> Rollout:
    """Run the direct method's loop over the whole task."""
    chosen = ending(scenario, horizon, kind)
    mpc = replace(controller("direct", chosen.ocp), parameters=chosen.parameters)
    return mpc.run(plant(scenario), scenario.theta0, DT * round(scenario.horizon / DT))
