"""What the receding-horizon driver and its recorder cost around a solver, on the arm.

The solver is one that knows the answer. Its own time is that of the ``Solution`` it builds and
checks; reading the warm start, which any solver does with as much of it as it wants, is timed
apart, for the states and controls that a direct method reads. All else is the driver's: the
checks of measurement and plan, the input from both, the decision.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.speed.arm import DT, N, arm
from ocp import MPC, OCP, Applied, FlightRecorder, Program, Solution, Solver, Start, solve
from solvers import MultipleShooting

# Steps at the beginning that do not count.
_WARM = 3


@dataclass(frozen=True)
class Overhead:
    """Times around the solver, a step [s]: median and 5 % quantile each."""

    driver: tuple[float, float]
    warm_start: tuple[float, float]
    recorder: tuple[float, float]


@dataclass(frozen=True, eq=False)
class _Times:
    """What each run took [s]."""

    reading: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class _Known(Solver):
    """A solver that knows the answer and counts its own time."""

    answer: Solution
    times: _Times

    def build(self, ocp: OCP) -> "_KnownProgram":
        return _KnownProgram(self, np.linspace(0.0, 1.0, N + 1))


@dataclass(frozen=True, eq=False)
class _KnownProgram(Program):
    solver: _Known
    nodes: np.ndarray

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: Start | None = None,
    ) -> Solution:
        started, answer = perf_counter(), self.solver.answer
        if guess:
            guess.sample("x", self.nodes, answer.x.shape[1])
            guess.sample("u", self.nodes[:-1], answer.u.shape[1])
        read = perf_counter()
        found = answer.with_(t=answer.t - answer.t[0] + t0)
        self.solver.times.reading.append(read - started)
        self.solver.times.whole.append(perf_counter() - started)
        return found


def driver_overhead(count: int = 500) -> Overhead:
    """Measure a number of steps."""
    ocp, times = arm(), _Times()
    answer = solve(ocp, MultipleShooting(N)).or_raise()
    mpc = MPC(ocp=ocp, solver=_Known(answer, times), dt=DT, applied=Applied("rate"))
    whole, recording, x = [], [], ocp.start()
    with TemporaryDirectory() as folder, FlightRecorder(mpc, Path(folder) / "flight") as recorder:
        for k in range(count + _WARM):
            started = perf_counter()
            decision = mpc.step(x, k * DT)
            between = perf_counter()
            recorder.watch(x, decision)
            recording.append(perf_counter() - between)
            whole.append(between - started)
    around = np.array(whole) - np.array(times.whole)
    return Overhead(*(_typical(t) for t in (around, times.reading, recording)))


def overhead_line(found: Overhead) -> str:
    """Return the times in words."""
    driver, warm_start, recorder = (
        f"{1e6 * median:.0f} us (5 % quantile {1e6 * least:.0f} us)"
        for median, least in (found.driver, found.warm_start, found.recorder)
    )
    return (
        f"the driver around its solver takes {driver} a step, reading the warm start "
        f"{warm_start}, the flight recorder {recorder} on top"
    )


def _typical(times: ArrayLike) -> tuple[float, float]:
    counted = np.asarray(times)[_WARM:]
    return float(np.median(counted)), float(np.quantile(counted, 0.05))
