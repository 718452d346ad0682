"""The comparison of thesis 3.2.6: every method's cost over the scenarios, and its work."""

from collections.abc import Callable, Sequence
from statistics import median

import numpy as np
from rich.table import Table

from benchmarks.claims.claim import Claim
from benchmarks.methods.tuned_kinematics import OFF_PATH
from benchmarks.sweep.row import Row

SUITE = "comparison"
_COLUMNS = (
    "method",
    "runs",
    "stands",
    "optimum",
    "lower quartile",
    "median",
    "upper quartile",
    "worst",
    "path error [m]",
    "iterations",
    "roll-outs",
    "sweeps",
    "per iteration",
)


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
        *(f"{quarter:.3f}" if quarter < 10.0 else f"{quarter:.0f}" for quarter in quarters),
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
    """Return what the rows on the closest link's cost can decide."""
    here = [row for row in rows if row.suite == SUITE and row.case.endswith("closest")]
    of = {name: [row for row in here if row.solver == name] for name in {r.solver for r in here}}
    found = [
        _tuned_claim(of.get("instantaneous", [])),
        _step_claim(of.get("schuetz-0.1", []), of.get("schuetz-0.01", [])),
        _segments_claim(of.get("indirect-15", [])),
    ]
    return tuple(claim for claim in found if claim is not None)


def _tuned_claim(rows: Sequence[Row]) -> Claim | None:
    gaps = gaps_of(rows)
    if not len(gaps):
        return None
    drift = max(row.task_drift if row.task_drift is not None else np.inf for row in rows)
    return Claim(
        "tuned instantaneous control keeps the path to 5 mm and costs more than every optimum",
        bool(drift <= OFF_PATH and gaps.min() > 0.0),
        f"path error {drift:.1e} m, gaps {gaps.min():.2f} to {gaps.max():.1f} %",
    )


def _step_claim(large: Sequence[Row], small: Sequence[Row]) -> Claim | None:
    one, other = gaps_of(large), gaps_of(small)
    if not len(one) or not len(other):
        return None
    return Claim(
        "Algorithm 2: median gap below 0.1 % at alpha = 0.01, upper quartile above it at 0.1",
        bool(np.median(other) < 0.1 < np.percentile(one, 75)),
        f"median {np.median(other):.3f} %, quartile {np.percentile(one, 75):.1f} %",
    )


def _segments_claim(rows: Sequence[Row]) -> Claim | None:
    gaps = gaps_of(rows)
    if not len(gaps):
        return None
    good = int((np.abs(gaps) <= 1e-3).sum())
    return Claim(
        "indirect multiple shooting from the direct answer: within 1e-5 on 95 % of the scenarios",
        good >= 0.95 * len(gaps),
        f"{good} of {len(gaps)}, kinks and all",
    )
