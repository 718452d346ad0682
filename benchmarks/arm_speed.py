"""What a warm-started step of MPC costs on the arm: interpreted, compiled, and the driver itself.

Times are processor times of this process; all contenders decide for the same measured states in
turns, so that ratios of one run mean something where the times do not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

import numpy as np
from numpy.typing import ArrayLike

from models import random_scenarios
from ocp import MPC, OCP, Applied, FlightRecorder, Outcome, Program, Solution, Solver, Start, solve
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


@dataclass(frozen=True)
class Overhead:
    """Time of the driver around its solver, a step [s]: median and 5 % quantile."""

    driver: tuple[float, float]
    recorder: tuple[float, float]


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
    guess = solve(ocp, MultipleShooting(N)).or_raise()
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


@dataclass(frozen=True)
class _Known(Solver):
    """A solver that knows the answer and counts its own time."""

    answer: Solution
    spent: list[float]

    def build(self, ocp: OCP) -> "_KnownProgram":
        return _KnownProgram(self)


@dataclass(frozen=True, eq=False)
class _KnownProgram(Program):
    solver: _Known

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: Start | None = None,
    ) -> Solution:
        started = perf_counter()
        answer = self.solver.answer
        found = answer.with_(t=answer.t - answer.t[0] + t0)
        self.solver.spent.append(perf_counter() - started)
        return found


def driver_overhead(count: int = 500) -> Overhead:
    """Measure ``MPC.step`` less the solver's own ``run``, and what the recorder takes on top."""
    ocp, spent = arm(), []
    answer = solve(ocp, MultipleShooting(N)).or_raise()
    mpc = MPC(ocp=ocp, solver=_Known(answer, spent), dt=DT, applied=Applied("rate"))
    whole, recording, x = [], [], ocp.start()
    with TemporaryDirectory() as folder, FlightRecorder(mpc, Path(folder) / "flight") as recorder:
        for k in range(count):
            started = perf_counter()
            decision = mpc.step(x, k * DT)
            between = perf_counter()
            recorder.watch(x, decision)
            recording.append(perf_counter() - between)
            whole.append(between - started)
    around = np.array(whole)[_WARM:] - np.array(spent)[_WARM:]
    recorded = np.array(recording)[_WARM:]
    driver, recorder_time = (
        (float(np.median(t)), float(np.quantile(t, 0.05))) for t in (around, recorded)
    )
    return Overhead(driver, recorder_time)


def exponent(sizes: tuple[int, ...], times: tuple[float, ...]) -> float:
    """Return the slope of log time over log size."""
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])
