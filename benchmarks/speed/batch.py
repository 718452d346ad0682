"""Throughput of ``solve_many`` with the native backend, beside ``run`` for one start at a time.

Processor times of this process, without the build, which happens once either way. Both solve for
the same starts in turns, so that ratios of one run mean something where the times do not.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from time import process_time

import numpy as np
from rich.table import Table

from benchmarks.speed.native import Race, races
from ocp import Solution
from solvers import ManySolutions, MultipleShooting, solve_many

# Solves that follow each other before the other one's turn.
_TURN = 128
# Standard deviation of the starts, relative to 1 + abs(x).
_SPREAD = 0.1


@dataclass(frozen=True)
class Throughput:
    """What both took for the same starts.

    Attributes:
        name: of the problem, and where the runs begin.
        one: processor time of a start of ``run``, of every turn [s].
        many: the same of ``solve_many`` on one thread [s].
        threaded: the same on all threads; the clock would measure who else is there [s].
        threads: how many these were.
        in_c: share that needed nothing but C.
        apart: largest difference of the states of both.
    """

    name: str
    one: np.ndarray
    many: np.ndarray
    threaded: np.ndarray
    threads: int
    in_c: float
    apart: float

    @property
    def ratio(self) -> float:
        """Starts for each second of a processor, as a multiple of one after the other."""
        return float(np.median(self.one / self.many))


class _Clock:
    """Processor time since the first report, which comes after the build."""

    def __init__(self) -> None:
        self.begun: float | None = None
        self.used = 0.0

    def __call__(self, done: int, total: int, said: str = "", /) -> None:
        """Note the first report and the last."""
        if self.begun is None:
            self.begun = process_time()
        self.used = process_time() - self.begun


def batches(count: int) -> Iterator[Throughput]:
    """Yield what ``count`` starts of each problem take, cold and from one solution."""
    for race in races():
        yield _measured(race, count, is_warm=False)
        if race.is_warm:
            yield _measured(race, count, is_warm=True)


def _measured(race: Race, count: int, *, is_warm: bool) -> Throughput:
    """Let both solve for the same starts, from the guess of the problem or from a solution."""
    solver = MultipleShooting(race.intervals, backend="native").unjudged()
    program, ocp = solver.build(race.ocp), race.ocp
    guess = program.run() if is_warm else None
    start, rng = np.asarray(ocp.start()), np.random.default_rng(0)
    starts = start + _SPREAD * (1.0 + np.abs(start)) * rng.normal(size=(count, len(start)))
    one, many, threaded, answers = [], [], [], []
    for x0 in np.array_split(starts, max(1, count // _TURN)):
        begun = process_time()
        single = [program.run(x0=x, guess=guess) for x in x0]
        one.append((process_time() - begun) / len(x0))
        alone, both = _Clock(), _Clock()
        found = solve_many(ocp, solver, x0=x0, guesses=guess, threads=1, progress=alone)
        solve_many(ocp, solver, x0=x0, guesses=guess, progress=both)
        many.append(alone.used / len(x0))
        threaded.append(both.used / len(x0))
        answers.append((single, found))
    threads = solve_many(ocp, solver, x0=starts[:1], guesses=guess).threads
    return Throughput(
        name=f"{race.name.removesuffix(', warm').removesuffix(', cold')}, "
        f"{'from one solution' if is_warm else 'cold'}",
        one=np.array(one),
        many=np.array(many),
        threaded=np.array(threaded),
        threads=threads,
        in_c=sum(found.in_c for _, found in answers) / count,
        apart=max(_apart(single, found) for single, found in answers),
    )


def _apart(single: list[Solution], found: ManySolutions) -> float:
    return max(float(np.abs(each.x - x).max()) for each, x in zip(single, found.x, strict=True))


def batch_table(found: list[Throughput]) -> Table:
    """Return one line a problem."""
    threads = found[0].threads
    table = Table(title="many starts: us of a processor for each")
    columns = ("problem", "run", "solve_many", f"on {threads} threads", "ratio", "in C", "apart")
    for column in columns:
        table.add_column(column, justify="left" if column == "problem" else "right", no_wrap=True)
    for each in found:
        measured = (each.one, each.many, each.threaded)
        times = [f"{1e6 * np.median(t):.0f}" for t in measured]
        table.add_row(
            each.name, *times, f"{each.ratio:.1f}", f"{each.in_c:.0%}", f"{each.apart:.0e}"
        )
    return table
