"""What a warm-started step of MPC costs on the arm: interpreted and compiled.

Times are processor times of this process; all contenders decide for the same measured states in
turns, so that ratios of one run mean something where the times do not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from models import random_scenarios
from ocp import MPC, OCP, Applied, Outcome, Solver, solve
from solvers import IndirectShooting, MultipleShooting, Schuetz, StagewiseNewton

INTERVALS = (10, 20, 35, 50, 100, 200)
LINKS = (3, 4, 6, 8, 10)
# The problem whose ratios are asked for: 35 intervals of 20 ms.
N, DT, HORIZON = 35, 0.02, 0.7
# Rate at which an error of the end effector decays (3.18) [1/s].
CORRECTION = 5.0
# Standard deviation of a measured joint [rad], so that no step starts at its own solution.
NOISE = 1e-3
# Steps at the beginning that do not count.
_WARM = 3


@dataclass(frozen=True)
class Steps:
    """The steps of one contender.

    Attributes:
        name: of the solver.
        compiled: whether its stages are machine code.
        times: of every step [s].
        planned: share of the steps that follow a new plan.
    """

    name: str
    compiled: bool
    times: tuple[float, ...]
    planned: float

    @property
    def median(self) -> float:
        """Median time of a step [s]."""
        return float(np.median(self.times))

    def over(self, other: "Steps") -> float:
        """Return the median ratio of the steps of this and of another contender."""
        return float(np.median(np.array(self.times) / np.array(other.times)))


def arm(links: int = 3) -> OCP:
    """Return an ordinary scenario over the horizon of one step."""
    scenario = random_scenarios(links, 1, seed=0)[0]
    return replace(scenario, horizon=HORIZON).ocp(correction=CORRECTION)


def contenders(intervals: int = N) -> dict[str, Solver]:
    """Return the solvers that are compared, by name."""
    return {
        "direct, ipopt": MultipleShooting(intervals),
        "direct, fatrop": MultipleShooting(intervals, backend="fatrop"),
        "stagewise Newton": StagewiseNewton(intervals),
        "indirect": IndirectShooting(segments=5, steps=intervals),
        "gradient": Schuetz.sound(intervals=intervals),
    }


def stagewise() -> dict[str, Solver]:
    """Return the solvers whose compiled stages are compared over the links."""
    names = ("direct, fatrop", "stagewise Newton")
    return {name: solver for name, solver in contenders().items() if name in names}


def arm_steps(
    solvers: Mapping[str, Solver], ocp: OCP, count: int, stages: Sequence[bool] = (False, True)
) -> list[Steps]:
    """Let every solver, interpreted and compiled, decide ``count`` steps of one motion in turns.

    The motion is that of the first contender; everybody sees it with the same noise.
    """
    guess = solve(ocp, MultipleShooting(N, compiled=True)).or_raise()
    racing = {
        (name, compiled): MPC(
            ocp=ocp, solver=solver, dt=DT, applied=Applied("rate"), guess=guess, compiled=compiled
        )
        for name, solver in solvers.items()
        for compiled in stages
    }
    times: dict[tuple[str, bool], list[float]] = {key: [] for key in racing}
    planned = dict.fromkeys(racing, 0)
    x, rng = ocp.start(), np.random.default_rng(0)
    for k in range(count + _WARM):
        measured, rates = x + NOISE * rng.normal(size=x.shape), []
        for key, mpc in racing.items():
            started = process_time()
            decision = mpc.step(measured, k * DT)
            times[key].append(process_time() - started)
            planned[key] += k >= _WARM and decision.outcome in (Outcome.OPTIMAL, Outcome.FEASIBLE)
            rates.append(decision.input)
        x = x + DT * rates[0]
    return [
        Steps(name, compiled, tuple(times[name, compiled][_WARM:]), planned[name, compiled] / count)
        for name, compiled in racing
    ]


def exponent(sizes: tuple[int, ...], times: tuple[float, ...]) -> float:
    """Return the slope of log time over log size."""
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])
