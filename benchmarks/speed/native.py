"""What one solve of the native backend costs, beside the other direct solvers with compiled stages.

Times are processor times of this process; all contenders solve for the same starts in turns, so
that ratios of one run mean something where the times do not.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from time import process_time

import numpy as np
from rich.table import Table

from benchmarks.speed.arm import N, arm
from models import cart_pole_swing_up, cart_pole_upright
from ocp import OCP, Program, Solution, Solver
from solvers import MultipleShooting, StagewiseNewton

# Solves at the beginning that do not count.
_WARM = 3
# Standard deviation of what a measured start differs by, relative to 1 + abs(x).
_NOISE = 1e-3
_NATIVE = "native"


@dataclass(frozen=True)
class Race:
    """One problem for all contenders that take it.

    Attributes:
        name: for the table.
        ocp: the problem.
        intervals: number of intervals.
        is_warm: whether each solve starts from the solution before it, for another start.
        has_newton: whether ``StagewiseNewton`` takes it.
    """

    name: str
    ocp: OCP
    intervals: int
    is_warm: bool
    has_newton: bool

    @property
    def solvers(self) -> Mapping[str, Solver]:
        """The contenders, as a control loop would run them."""
        n = self.intervals
        all_of_them: dict[str, Solver] = {
            _NATIVE: MultipleShooting(n, backend="native"),
            "fatrop": MultipleShooting(n, backend="fatrop", time_limit=np.inf),
            "ipopt": MultipleShooting(n),
        }
        if self.has_newton:
            all_of_them["stagewise Newton"] = StagewiseNewton(n)
        limits = {"compiled": True, "time_limit": np.inf}
        return {name: each.for_control_loop(**limits) for name, each in all_of_them.items()}


@dataclass(frozen=True)
class Solves:
    """The solves of one contender.

    Attributes:
        name: of the contender.
        times: of every solve [s].
        iterations: the mean.
        solved: share of successes.
    """

    name: str
    times: np.ndarray
    iterations: float
    solved: float


def races() -> list[Race]:
    """Return the problems that are measured."""
    free, tight = cart_pole_upright(track=np.inf), cart_pole_upright(track=0.5, force=8.0)
    return [
        Race(f"arm, N = {N}, warm", arm(), N, is_warm=True, has_newton=True),
        Race("cart-pole, N = 40, warm", free, 40, is_warm=True, has_newton=True),
        Race("the same on a short track", tight, 40, is_warm=True, has_newton=False),
        Race("swing-up, N = 100, cold", cart_pole_swing_up(), 100, is_warm=False, has_newton=False),
    ]


def measured(race: Race, count: int) -> list[Solves]:
    """Let all contenders solve ``count`` times."""
    programs = {name: solver.build(race.ocp) for name, solver in race.solvers.items()}
    last: dict[str, Solution] = {}
    found: dict[str, list[tuple[float, Solution]]] = {name: [] for name in programs}
    rng, start = np.random.default_rng(0), np.asarray(race.ocp.start())
    for _ in range(count + _WARM):
        x0 = start + _NOISE * (1.0 + np.abs(start)) * rng.normal(size=start.shape)
        for name, program in programs.items():
            guess = last.get(name) if race.is_warm else None
            found[name].append(_timed(program, x0, guess))
            last[name] = found[name][-1][1]
    return [_solves(name, runs[_WARM:]) for name, runs in found.items()]


def _timed(program: Program, x0: np.ndarray, guess: Solution | None) -> tuple[float, Solution]:
    started = process_time()
    solution = program.run(x0=x0, guess=guess)
    return process_time() - started, solution


def _solves(name: str, runs: list[tuple[float, Solution]]) -> Solves:
    solutions = [solution for _, solution in runs]
    return Solves(
        name=name,
        times=np.array([time for time, _ in runs]),
        iterations=float(np.mean([s.iterations for s in solutions])),
        solved=float(np.mean([s.status.is_success for s in solutions])),
    )


def native_table(race: Race, solves: list[Solves]) -> Table:
    """Return one line a contender: median, 99 %, worst, and the median ratio to the native one."""
    table = Table(title=f"{race.name}: one solve, in turns")
    for column in ("solver", "ms", "99 %", "worst", "of native", "iterations", "solved"):
        table.add_column(column, justify="left" if column == "solver" else "right", no_wrap=True)
    own = next(s.times for s in solves if s.name == _NATIVE)
    for s in solves:
        spread = [f"{1e3 * value:.2f}" for value in np.quantile(s.times, [0.5, 0.99, 1.0])]
        ratio = f"{np.median(s.times / own):.2f}"
        table.add_row(s.name, *spread, ratio, f"{s.iterations:.1f}", f"{s.solved:.0%}")
    return table
