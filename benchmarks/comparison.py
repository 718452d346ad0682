"""The comparison of thesis 3.2.6: every method's cost over the scenarios, and its work."""

from collections.abc import Callable, Sequence
from statistics import median

import numpy as np
from rich.table import Table

from benchmarks.claims import Claim
from benchmarks.row import Row

SUITE = "comparison"
_COLUMNS = (
    "method",
    "runs",
    "stands",
    "optimum",
    "quartile",
    "median",
    "quartile",
    "worst",
    "path error [m]",
    "iterations",
    "roll-outs",
    "sweeps",
    "per iteration",
)
# Of the thesis' single scenario: what 3.2.6 reports [%].
_THESIS = {"instantaneous": 14.079, "schuetz": 6.5784}


def comparison_table(rows: Sequence[Row], combine: str) -> Table | None:
    """Return the table for one distance cost, or None if there is no row.

    "stands": the method says that it has converged, or done what it could; "optimum": those
    within the gap of the certified optimum. Quartiles, median and worst are of the gaps [%] of
    *all* rows that have a certified optimum, whatever the method says of itself. The path error
    is the largest. Work is the median: roll-outs are integrations of the trajectory, sweeps
    integrations of derivatives along it, "per iteration" both over the iterations.
    """
    here = [row for row in rows if row.suite == SUITE and row.case.endswith(combine)]
    if not here:
        return None
    table = Table(title=f"cost above the certified optimum [%], '{combine}' (thesis 3.2.6)")
    for column in _COLUMNS:
        table.add_column(column, justify="left" if column == "method" else "right", no_wrap=True)
    for name in dict.fromkeys(row.solver for row in here):
        table.add_row(name, *_cells([row for row in here if row.solver == name]))
    return table


def _cells(rows: Sequence[Row]) -> list[str]:
    gaps = gaps_of(rows)
    known = [row for row in rows if row.reference is not None]
    quarters = np.percentile(gaps, [25, 50, 75, 100]) if len(gaps) else []
    drifts = [row.task_drift for row in rows if row.task_drift is not None]
    return [
        str(len(rows)),
        str(sum(row.status in _STANDS for row in rows)),
        f"{sum(abs(gap) <= 0.5 for gap in gaps)}/{len(known)}",
        *(f"{quarter:.3g}" for quarter in quarters),
        *["-"] * (4 - len(quarters)),
        f"{max(drifts):.0e}" if drifts else "-",
        *(f"{_median(of, rows):.0f}" for of in (_iterations, _rollouts, _sweeps)),
        _per_iteration(rows),
    ]


_STANDS = {"SOLVED", "STATIONARY", "MYOPIC", "SMALL_DECREASE"}


def gaps_of(rows: Sequence[Row]) -> np.ndarray:
    """Return the gaps [%] of the rows with a finite cost and a certified optimum."""
    return np.array([100.0 * row.gap for row in rows if row.gap is not None])


def _iterations(row: Row) -> float:
    return row.iterations


def _rollouts(row: Row) -> float:
    return row.rollouts


def _sweeps(row: Row) -> float:
    return row.jacobians


def _median(of: Callable[[Row], float], rows: Sequence[Row]) -> float:
    return median(of(row) for row in rows)


def _per_iteration(rows: Sequence[Row]) -> str:
    shares = [(row.rollouts + row.jacobians) / row.iterations for row in rows if row.iterations]
    return f"{median(shares):.1f}" if shares else "-"


def comparison_claims(rows: Sequence[Row]) -> tuple[Claim, ...]:
    """Return what these rows can decide of the comparison."""
    return ()
