"""What one solve of the native backend costs, beside other solvers, and what is around it.

Times of the race are processor times of this process; all contenders solve for the same starts in
turns, so that ratios of one run mean something where the times do not. Around a control step the
clock of the library, of the solver's ``run`` and of ``MPC.step`` run side by side.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np
from rich.table import Table

from benchmarks.speed.arm import DT, N, arm
from benchmarks.speed.timed_solver import Timed
from models import cart_pole_swing_up, cart_pole_upright
from ocp import MPC, OCP, InputSource, PlantInput, Program, Solution, Solver
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
        dt: sampling interval of a controller [s].
        applies_rate: whether the plant receives the rate of the state.
    """

    name: str
    ocp: OCP
    intervals: int
    is_warm: bool
    has_newton: bool
    dt: float = 0.02
    applies_rate: bool = False

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
        Race(
            f"arm, N = {N}, warm", arm(), N, is_warm=True, has_newton=True, dt=DT, applies_rate=True
        ),
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


@dataclass(frozen=True)
class Layers:
    """A control step of the native backend and what is inside it, for the same steps.

    Attributes:
        in_c: the solve by the clock of the library [s].
        run: the solver's ``run`` [s].
        step: ``MPC.step``, ladder included [s].
        busy: of ``MPC.step`` the processor time, which others on the machine do not lengthen [s].
        optimal: share of steps that follow a new optimal plan.
    """

    in_c: np.ndarray
    run: np.ndarray
    step: np.ndarray
    busy: np.ndarray
    optimal: float


def layers(race: Race, steps: int) -> Layers:
    """Let a controller decide for states around the start, each time from the plan before."""
    solver, rng, start = Timed(race.solvers[_NATIVE]), np.random.default_rng(0), race.ocp.start()
    applied = PlantInput("rate" if race.applies_rate else "control")
    mpc = MPC(ocp=race.ocp, solver=solver, dt=race.dt, applied=applied)
    times, busy, optimal = [], [], 0
    for _ in range(steps + _WARM):
        x = start + _NOISE * (1.0 + np.abs(start)) * rng.normal(size=start.shape)
        used, started = process_time(), perf_counter()
        decision = mpc.step(x, 0.0)
        times.append(perf_counter() - started)
        busy.append(process_time() - used)
        optimal += decision.source is InputSource.OPTIMAL
    measured = (solver.in_c, solver.times, times, busy)
    return Layers(*[np.array(each)[_WARM:] for each in measured], optimal=optimal / len(times))


def layers_table(race: Race, found: Layers) -> Table:
    """Return one line a layer, with its median ratio to the solve."""
    title = f"{race.name}: {len(found.step)} control steps, {found.optimal:.0%} optimal, in us"
    table = Table(title=title)
    for column in ("layer", "median", "99 %", "99.9 %", "worst", "of the solve"):
        table.add_column(column, justify="left" if column == "layer" else "right", no_wrap=True)
    named = {"the solve, in C": found.in_c, "the solver's run": found.run, "MPC.step": found.step}
    named["MPC.step, processor time"] = found.busy
    for name, times in named.items():
        spread = [f"{1e6 * value:.0f}" for value in np.quantile(times, [0.5, 0.99, 0.999, 1.0])]
        table.add_row(name, *spread, f"{np.median(times / found.in_c):.2f}")
    return table


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
