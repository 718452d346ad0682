"""``python -m benchmarks mpc`` and ``faults``."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.cases import arm_scenario
from benchmarks.mpc.dial import HORIZONS, crossings_table, sweep
from benchmarks.mpc.endings import ENDINGS, loop_with
from benchmarks.mpc.faults import SUBJECTS, campaign
from benchmarks.mpc.late import DELAY, delayed_loops
from benchmarks.mpc.loop_row import LoopRow
from benchmarks.mpc.mass_loop import DT, receding
from benchmarks.mpc.tables import faults_table, loops_table, said

_SHORT = (0.02, 0.06, 0.1, 0.2, 0.3)  # [s]
_ENDED = ("arm-001", "arm-002", "arm-004")
_DELAYED, _MASS_HORIZONS = 0.35, (5, 10, 20, 40)
# A step of the arm costs several of the cart.
_SHARES = {"cart": 0.8, "arm": 0.2}


def print_loops(
    console: Console, out: Path, scenarios: Sequence[str], controllers: Sequence[str]
) -> int:
    """Run the arm's loops that are not in ``out`` yet and print the rows; return 0."""
    rows = list(sweep(out, scenarios, controllers, HORIZONS))
    console.print(loops_table(rows, "closed loops of the arm, dt = 20 ms, cost by the plant"))
    console.print(crossings_table(rows))
    return 0


def print_endings(console: Console) -> int:
    """Run short horizons with terminal costs, and a delay, and the mass of 2.92; return 0."""
    rows = []
    for name in _ENDED:
        for horizon in _SHORT:
            for kind in ENDINGS:
                rollout = loop_with(arm_scenario(name), horizon, kind)
                rows.append(LoopRow.of(name, "direct", horizon, rollout, ending=kind))
    console.print(loops_table(rows, "terminal costs"))
    late = delayed_loops(_ENDED[0], _DELAYED)
    rows = [LoopRow.of(_ENDED[0], what, _DELAYED, rollout) for what, rollout in late.items()]
    console.print(loops_table(rows, f"a computing delay of {1e3 * DELAY:g} ms"))
    mass = {n: receding(n, bounded=True) for n in _MASS_HORIZONS}
    rows = [LoopRow.of("mass 2.92", "linear", DT * n, rollout) for n, rollout in mass.items()]
    console.print(loops_table(rows, "the mass of 2.92, |position| <= 2 m"))
    return 0


def print_faults(console: Console, steps: int, seed: int) -> int:
    """Run the campaign and print it; return 0 if it is clean."""
    reports = [campaign(name, max(1, round(_SHARES[name] * steps)), seed=seed) for name in SUBJECTS]
    for report in reports:
        console.print(faults_table(report))
        console.print(said(report))
    return int(not all(report.is_clean for report in reports))
