"""The dial from instantaneous control to the optimum: the length of the horizon (3.19)."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from rich.markup import escape
from rich.table import Table

from benchmarks.cases import all_cases, arm_scenario
from benchmarks.mpc.arm_loop import INSTANTANEOUS, loop
from benchmarks.mpc.loop_row import PART, LoopRow, found, read_loops
from models import ArmScenario

LOOPS = "loops.jsonl"
HORIZONS = (0.02, 0.06, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.5)
# The two that the thesis compares; the direct method is the yardstick of both.
COMPARED = ("direct", "shooting", "schuetz")
# Costs that differ by less are the same.
_SAME = 1e-3
SCENARIOS = tuple(f"arm-{i:03d}" for i in range(1, 11))


def sweep(
    out: Path,
    scenarios: Sequence[str],
    kinds: Sequence[str],
    horizons: Sequence[float],
    say: Callable[[str], object] = lambda note: None,
) -> Iterator[LoopRow]:
    """Run the loops that ``out`` has no row of, and yield the rows of all; see ``read_loops``."""
    known = {row.key: row for row in read_loops(out / LOOPS, say)}
    for name in scenarios:
        wanted = [(INSTANTANEOUS, 0.0), *((kind, h) for h in horizons for kind in kinds)]
        for kind, horizon in wanted:
            row = known.get((name, kind, horizon, "none"))
            if row is None:
                row = one(arm_scenario(name), kind, horizon)
                row.append_to(out / LOOPS)
            yield row


@cache
def one(scenario: ArmScenario, kind: str, horizon: float) -> LoopRow:
    """Run one loop."""
    return LoopRow.of(scenario.name, kind, horizon, loop(scenario, kind, horizon))


def stays_below(
    mine: Mapping[float, LoopRow], other: Mapping[float, LoopRow] | LoopRow, part: bool
) -> float | None:
    """Return the shortest horizon from which on my cost is never above the other's; or None.

    Args:
        mine: rows by horizon.
        other: rows by horizon, or one row that has none.
        part: whether the first 0.8 s count, or the whole task.
    """
    shortest = None
    for horizon in sorted(mine, reverse=True):
        row = other if isinstance(other, LoopRow) else other.get(horizon)
        if row is None:
            continue
        if _cost(mine[horizon], part) > _cost(row, part) * (1.0 + _SAME):
            break
        shortest = horizon
    return shortest


def _cost(row: LoopRow, part: bool) -> float:
    value = row.part if part else row.cost
    return np.inf if value is None else value


def crossings_table(rows: Sequence[LoopRow]) -> Table:
    """Return, for each scenario, from which horizon on one controller costs less than another."""
    table = Table(title=escape("from which horizon on [s] (-: from none)"))
    heads = ("direct beats instantaneous", "Schuetz beats instantaneous", "shooting beats Schuetz")
    table.add_column("scenario")
    for head in heads:
        for end in (f"{PART:g}", "1.5"):
            table.add_column(f"{head}, {end} s", justify="right")
    table.add_column("cost at 1.5 s over the optimum", justify="right")
    for name in dict.fromkeys(row.case for row in rows):
        table.add_row(name, *_crossings(rows, name))
    return table


def _crossings(rows: Sequence[LoopRow], name: str) -> list[str]:
    direct, shooting, schuetz = (found(rows, name, kind) for kind in COMPARED)
    still = found(rows, name, INSTANTANEOUS).get(0.0)
    cells = []
    for mine, other in ((direct, still), (schuetz, still), (shooting, schuetz)):
        for part in (True, False):
            at = None if other is None else stays_below(mine, other, part)
            cells.append("no instantaneous" if other is None else "-" if at is None else f"{at:g}")
    longest = direct.get(HORIZONS[-1])
    best = optimum(name)
    gap = np.inf if longest is None else _cost(longest, part=False) / best - 1.0
    return [*cells, f"{100 * gap:+.2f} %"]


def optimum(name: str) -> float:
    """Return the certified optimum of the whole task."""
    (case,) = (case for case in all_cases() if case.name == f"{name}-sum")
    assert case.reference is not None
    return case.reference.value
