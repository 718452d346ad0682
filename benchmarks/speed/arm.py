"""What a warm-started step of MPC costs on the arm: interpreted and compiled.

Times are processor times of this process; all contenders decide for the same measured states in
turns, so that ratios of one run mean something where the times do not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from models import random_scenarios
from ocp import MPC, OCP, PlantInput, Solver, solve
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
        # In this process, whose time is measured.
        "direct, fatrop": MultipleShooting(intervals, backend="fatrop", time_limit=np.inf),
        "stagewise Newton": StagewiseNewton(intervals),
        "indirect": IndirectShooting(segments=5, steps=intervals),
        "gradient": Schuetz.sound(intervals=intervals),
    }


def stagewise() -> dict[str, Solver]:
    """Return the solvers whose compiled stages are compared over the links."""
    names = ("direct, fatrop", "stagewise Newton")
    return {name: solver for name, solver in contenders().items() if name in names}


@dataclass(frozen=True)
class Field:
    """Contenders on one problem.

    Attributes:
        ocp: the problem.
        solvers: by name.
        stages: whether they are compiled; both by default.
    """

    ocp: OCP
    solvers: Mapping[str, Solver]
    stages: Sequence[bool] = (False, True)

    def line_up(self) -> "Racing":
        """Build the controllers."""
        guess = solve(self.ocp, MultipleShooting(N, compiled=True)).or_raise()
        applied = PlantInput("rate")
        racing = {
            (name, compiled): MPC(
                ocp=self.ocp, solver=solver, dt=DT, applied=applied, guess=guess, compiled=compiled
            )
            for name, solver in self.solvers.items()
            for compiled in self.stages
        }
        return Racing(racing, self.ocp.start())


class Racing:
    """The contenders of a field on their way; the motion is that of the first one."""

    def __init__(self, racing: Mapping[tuple[str, bool], MPC], x: np.ndarray) -> None:
        """Put them at the start."""
        self._racing, self._x = racing, x
        self._times: dict[tuple[str, bool], list[float]] = {key: [] for key in racing}
        self._planned = dict.fromkeys(racing, 0)
        self._rng = np.random.default_rng(0)

    def step(self, k: int) -> None:
        """Let everybody decide in turns, for the same measured state."""
        measured = self._x + NOISE * self._rng.normal(size=self._x.shape)
        rates = []
        for key, mpc in self._racing.items():
            started = process_time()
            decision = mpc.step(measured, k * DT)
            self._times[key].append(process_time() - started)
            is_new = decision.source.is_planned
            self._planned[key] += k >= _WARM and is_new
            rates.append(decision.input)
        self._x = self._x + DT * rates[0]

    def results(self) -> list[Steps]:
        """Return what was measured, without the first steps."""
        return [
            Steps(*key, tuple(times := self._times[key][_WARM:]), self._planned[key] / len(times))
            for key in self._racing
        ]


def race(fields: Mapping[int, Field], count: int) -> dict[int, list[Steps]]:
    """Let the contenders of all fields decide ``count`` steps.

    The fields take turns too: a processor changes its clock within seconds, and what grows over
    the keys must not be that.
    """
    racing = {key: field.line_up() for key, field in fields.items()}
    for k in range(count + _WARM):
        for group in racing.values():
            group.step(k)
    return {key: group.results() for key, group in racing.items()}


def exponent(sizes: tuple[int, ...], times: tuple[float, ...]) -> float:
    """Return the slope of log time over log size."""
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])
