"""What is claimed of the suite ``library``, checked against the rows of a run."""

from collections.abc import Sequence

from benchmarks.cases import LIBRARY, Case
from benchmarks.claims.claim import Claim
from benchmarks.methods.library_tolerances import TOLERANCES, Tolerance
from benchmarks.sweep.row import Row
from ocp import Status

SUITE = "library"


def library_claims(rows: Sequence[Row]) -> tuple[Claim, ...]:
    """Return a claim for each method that these rows can decide."""
    cases = {case.name: case for case in LIBRARY}
    here = [row for row in rows if row.suite == SUITE and row.case in cases]
    names = dict.fromkeys(row.solver for row in here)
    return tuple(_claim(name, [r for r in here if r.solver == name], cases) for name in names)


def _claim(solver: str, rows: Sequence[Row], cases: dict[str, Case]) -> Claim:
    bad = [row for row in rows if not within(row, cases[row.case])]
    worst = "; ".join(f"{r.case}: {r.status}, gap {r.gap}, violation {r.violation}" for r in bad)
    return Claim(
        f"{solver}: within its tolerance on every case that declares it",
        not bad,
        worst or f"{len(rows)} of {len(rows)}",
    )


def within(row: Row, case: Case) -> bool:
    """Whether a row keeps the tolerance table: success, distance from the interval, violation."""
    tolerance = tolerance_of(row.solver, case)
    if tolerance is None or case.reference is None or row.cost is None or row.violation is None:
        return False
    far, violated = tolerance
    outside = max(row.cost - case.reference.upper, case.reference.lower - row.cost, 0.0)
    return (
        Status[row.status].is_success
        and outside <= far * abs(case.reference.value)
        and row.violation <= violated
    )


def tolerance_of(solver: str, case: Case) -> Tolerance | None:
    """Return the entry of the table; None: the method has none for this difficulty."""
    return TOLERANCES.get(solver, {}).get(case.difficulty)
