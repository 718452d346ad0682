"""What the receding-horizon driver and its recorder cost around a solver, on the arm.

All is timed but the solver's ``run``: the checks of measurement and plan, the input from both, the
decision; of the warm start only that it is offered. The same driver is timed around five solvers,
in turns. Three are a stand-in that knows the answer: alone; after it has really solved the problem
with compiled fatrop and thrown that away; after it has slept. Then compiled fatrop itself, in this
process and, as a limit of time has it, in one of its own.
What the second costs more than the first is what the driver's own code and data cost once somebody
else has used the caches of the processor. The third says that this needs no solver: a controller
that waits for its next sample is in no better place.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

import numpy as np
from numpy.typing import ArrayLike
from rich.table import Table

from benchmarks.speed.arm import DT, NOISE, N, arm
from benchmarks.speed.timed_solver import Timed
from ocp import MPC, OCP, FlightRecorder, InitialGuess, PlantInput, Program, Solution, Solver, solve
from solvers import MultipleShooting

# In this process, so that it uses the same caches.
FATROP = MultipleShooting(N, backend="fatrop", compiled=True, time_limit=np.inf)
# Turns at the beginning that do not count, and steps of a turn: the last one does.
_WARM, _TURN = 3, 2
_SLEEP = 0.01  # [s]


@dataclass(frozen=True)
class Spread:
    """The least and the median of some times [s]."""

    least: float
    median: float

    @classmethod
    def of(cls, times: ArrayLike) -> "Spread":
        """Take the last step of every turn but the first ones."""
        counted = np.asarray(times)[_TURN - 1 :: _TURN][_WARM:]
        return cls(float(counted.min()), float(np.median(counted)))

    def __str__(self) -> str:
        """Return both in microseconds."""
        return f"{1e6 * self.least:.0f} / {1e6 * self.median:.0f}"


@dataclass(frozen=True)
class Overhead:
    """Times of a step around one solver.

    Attributes:
        solver: which.
        solving: of the solver's own.
        driver: of all else.
        recorder: of the flight recorder on top.
    """

    solver: str
    solving: Spread
    driver: Spread
    recorder: Spread


# What else a stand-in does with x0 and t0.
_Work = Callable[[ArrayLike | None, float], object]


@dataclass(frozen=True, eq=False)
class _StandIn(Solver):
    """A solver that knows the answer."""

    answer: Solution
    work: _Work

    def build(self, ocp: OCP) -> "_StandInProgram":
        return _StandInProgram(self.answer, self.work)


@dataclass(frozen=True, eq=False)
class _StandInProgram(Program):
    answer: Solution
    work: _Work

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        self.work(x0, t0)
        x = self.answer.x.copy()
        if x0 is not None:  # a plan from elsewhere would be refused
            x[0] = x0
        return self.answer.with_(t=self.answer.t - self.answer.t[0] + t0, x=x)


def _contenders(ocp: OCP) -> dict[str, Solver]:
    answer, real = solve(ocp, MultipleShooting(N)).or_raise(), FATROP.build(ocp)

    def solved(x0: ArrayLike | None, t0: float) -> None:
        real.run(x0=x0, t0=t0, guess=answer)

    return {
        "stand-in": _StandIn(answer, lambda x0, t0: None),
        "stand-in, after fatrop": _StandIn(answer, solved),
        f"stand-in, after {1e3 * _SLEEP:.0f} ms asleep": _StandIn(
            answer, lambda x0, t0: sleep(_SLEEP)
        ),
        "fatrop": FATROP,
        "fatrop, apart": replace(FATROP, time_limit=10.0),
    }


def driver_overhead(count: int = 200) -> list[Overhead]:
    """Measure a step of every contender, a number of times in turns, for the same states.

    In its turn a contender decides twice and the second decision counts, so that what it finds in
    the caches is its own.
    """
    ocp, rng = arm(), np.random.default_rng(0)
    timed = {name: Timed(solver) for name, solver in _contenders(ocp).items()}
    racing = {
        name: MPC(ocp=ocp, solver=solver, dt=DT, applied=PlantInput("rate"))
        for name, solver in timed.items()
    }
    whole, recording = ({name: [] for name in racing} for _ in range(2))
    with TemporaryDirectory() as folder, ExitStack() as files:
        recorders = {
            name: files.enter_context(FlightRecorder(mpc, Path(folder) / f"flight {k}"))
            for k, (name, mpc) in enumerate(racing.items())
        }
        for _ in range(count + _WARM):
            x = ocp.start() + NOISE * rng.normal(size=ocp.model.nx)
            for name, mpc in [turn for turn in racing.items() for _ in range(_TURN)]:
                started = perf_counter()
                decision = mpc.step(x, 0.0)
                between = perf_counter()
                recorders[name].watch(x, decision)
                recording[name].append(perf_counter() - between)
                whole[name].append(between - started)
    return [
        Overhead(
            name,
            Spread.of(solver.times),
            Spread.of(np.subtract(whole[name], solver.times)),
            Spread.of(recording[name]),
        )
        for name, solver in timed.items()
    ]


def overhead_table(found: list[Overhead]) -> Table:
    """Return one line a contender."""
    table = Table(title=f"arm, 3 links, N = {N}: a step in us, least / median")
    for column in ("around", "the solver", "the driver", "the flight recorder"):
        justify = "left" if column == "around" else "right"
        table.add_column(column, justify=justify, no_wrap=True)
    for line in found:
        table.add_row(line.solver, str(line.solving), str(line.driver), str(line.recorder))
    return table
