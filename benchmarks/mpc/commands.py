"""``python -m benchmarks mpc`` and ``faults``."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.mpc.dial import HORIZONS, crossings_table, sweep
from benchmarks.mpc.faults import SUBJECTS, campaign
from benchmarks.mpc.tables import faults_table, loops_table, said

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


def print_faults(console: Console, steps: int, seed: int) -> int:
    """Run the campaign and print it; return 0 if it is clean."""
    reports = [campaign(name, max(1, round(_SHARES[name] * steps)), seed=seed) for name in SUBJECTS]
    for report in reports:
        console.print(faults_table(report))
        console.print(said(report))
    return int(not all(report.is_clean for report in reports))
