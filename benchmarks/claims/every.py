"""What the toolkit claims of itself, checked against the rows of a run."""

from collections.abc import Iterable, Sequence
from math import log2
from statistics import median

from benchmarks.claims.claim import Claim
from benchmarks.claims.clearance import clearance_claims
from benchmarks.claims.library import library_claims
from benchmarks.sweep.row import Row

# A trajectory that violates a constraint by more may gain by it.
FEASIBLE = 1e-6
# What a violation that still counts as none may gain, relative to the reference: a cost further
# below the reference's lower end disproves it.
BELOW_REFERENCE = 1e-6


def below_reference(rows: Iterable[Row]) -> tuple[Row, ...]:
    """Return the rows that cost less than the lower end of a reference, whatever their status.

    Each disproves its reference.
    """
    return tuple(
        row
        for row in rows
        if row.cost is not None
        and row.lower is not None
        and row.cost < row.lower - BELOW_REFERENCE * abs(row.lower)
        and row.violation is not None
        and row.violation <= FEASIBLE
    )


def claims_of(rows: Sequence[Row]) -> tuple[Claim, ...]:
    """Return the claims on the suites ``arm``, ``clearance`` and ``library``, as far as decided."""
    every = {name: _of(rows, name) for name in dict.fromkeys(row.solver for row in rows)}
    found = [
        _gap_claim(every.get("direct-75", ())),
        _refinement_claim(every.get("direct-75", ()), every.get("direct-150", ())),
        _polish_claim(every.get("polish", ())),
        _scan_claim(every.get("extremals", ())),
        _basin_claim(every.get("schuetz-sound", ())),
        _multiple_claim(every.get("indirect-15", ())),
    ]
    decided = (claim for claim in found if claim is not None)
    return (*decided, *clearance_claims(rows), *library_claims(rows))


def _of(rows: Sequence[Row], solver: str) -> tuple[Row, ...]:
    """The rows of a method on the arm's smooth cost, where a reference is known."""
    return tuple(
        row
        for row in rows
        if row.suite == "arm" and row.solver == solver and row.case.endswith("sum")
    )


def _gap_claim(rows: Sequence[Row]) -> Claim | None:
    if not rows:
        return None
    gaps = [_gap(row) for row in rows]
    return Claim(
        "direct multiple shooting, 75 intervals: median gap <= 2e-4, all <= 2e-3",
        median(gaps) <= 2e-4 and max(gaps) <= 2e-3,
        f"median {median(gaps):.1e}, worst {max(gaps):.1e} over {len(gaps)}",
    )


def _refinement_claim(coarse: Sequence[Row], fine: Sequence[Row]) -> Claim | None:
    finer = {row.setting: row for row in fine}
    pairs = [(row, finer[row.setting]) for row in coarse if row.setting in finer]
    ratios = [_gap(b) / _gap(a) if a.solved and b.solved else float("inf") for a, b in pairs]
    if not ratios:
        return None
    good = sum(ratio <= 0.35 for ratio in ratios)
    return Claim(
        "twice the intervals: gap at most 0.35 of that before on 36 of 40",
        good >= 0.9 * len(ratios),
        f"{good} of {len(ratios)}, median ratio {median(ratios):.3f}",
    )


def _polish_claim(rows: Sequence[Row]) -> Claim | None:
    if not rows:
        return None
    good = [
        row.status == "SOLVED"
        and abs(_gap(row)) <= 1e-6
        and _residual(row) <= 1e-10
        and row.iterations <= 3 * _rounds(row)
        for row in rows
    ]
    return Claim(
        "polish: gap within 1e-6, residual <= 1e-10, at most 3 Newton steps each time, on all",
        all(good),
        f"{sum(good)} of {len(good)}; worst gap {max(abs(_gap(row)) for row in rows):.1e}, "
        f"residual {max(map(_residual, rows)):.1e}, "
        f"steps {max(row.iterations for row in rows)}",
    )


def _rounds(row: Row) -> float:
    """How often Newton ran: once, and once more for every doubling of 300 steps."""
    return 1.0 + max(0.0, log2((row.intervals or 300) / 300))


def _scan_claim(rows: Sequence[Row]) -> Claim | None:
    if not rows:
        return None
    good = sum(abs(_gap(row)) <= 1e-6 for row in rows)
    return Claim(
        "enumerated extremals: the cheapest is the reference, to 1e-6, on 38 of 40",
        good >= 0.95 * len(rows),
        f"{good} of {len(rows)}, worst gap {max(abs(_gap(row)) for row in rows):.1e}",
    )


def _basin_claim(rows: Sequence[Row]) -> Claim | None:
    if not rows:
        return None
    gaps = [abs(row.local_gap) if row.local_gap is not None else float("inf") for row in rows]
    good = sum(gap <= 1e-3 for gap in gaps)
    return Claim(
        "Schuetz with line search: within 1e-3 of the bottom of its own basin on 38 of 40",
        good >= 0.95 * len(gaps),
        f"{good} of {len(gaps)}, worst {max(gaps):.1e}",
    )


def _multiple_claim(rows: Sequence[Row]) -> Claim | None:
    if not rows:
        return None
    good = sum(bool(row.optimum) for row in rows)
    return Claim(
        "indirect multiple shooting from the direct answer: the optimum on 38 of 40",
        good >= 0.95 * len(rows),
        f"{good} of {len(rows)}",
    )


def _gap(row: Row) -> float:
    return row.gap if row.gap is not None and row.solved else float("inf")


def _residual(row: Row) -> float:
    return row.residual if row.residual is not None else float("inf")
