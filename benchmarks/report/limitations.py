"""What these numbers do not say."""

from collections.abc import Sequence

from benchmarks.report.section import Points, Section
from benchmarks.sweep.row import Row

_ALWAYS = (
    "The problems are those of one library, most of them arms that follow a line: a method that "
    "is good here need not be good elsewhere.",
    "Every method runs with the options listed above, nobody has tuned them for a case.",
    "Times are wall-clock times of single runs, beside whatever else the machine did. Iterations, "
    "integrations and factorisations do not depend on that.",
    "A solve time leaves out building the problem (not so for “extremals”). A method that "
    "begins where another ended does not count the time of that one, and the best of several "
    "starts has its own time only.",
    "Integrations are those that a method counts itself. Each motion of the scan of “extremals” "
    "is one; the second-order tests of “polish” and “extremals” and the referee are not counted.",
    "A gap is as good as its reference, and says nothing about a case without one. Stationarity, "
    "which is judged there, does not tell a minimum from another extremal.",
    "Performance profiles compare all methods at once: taking one away can change the order of "
    "the others.",
)


def limitations(rows: Sequence[Row]) -> Section:
    """Return the section on limitations, those of these rows last."""
    return Section("limitations", "Limitations", [Points([*_ALWAYS, *_of_these(rows)])])


def _of_these(rows: Sequence[Row]) -> list[str]:
    found = []
    machines = len({tuple(sorted(row.machine.items())) for row in rows})
    versions = len({tuple(sorted(row.versions.items())) for row in rows})
    unknown = {(row.suite, row.case) for row in rows}
    unknown -= {(row.suite, row.case) for row in rows if row.reference is not None}
    lost = sum(row.is_lost for row in rows)
    if machines > 1:
        found.append(f"These rows are from {machines} machines: their times cannot be compared.")
    if versions > 1:
        found.append(f"These rows are from {versions} sets of versions.")
    if len({row.seed for row in rows}) == 1:
        found.append("One seed: what a method owes to luck with its starts does not show.")
    if unknown:
        found.append(f"{len(unknown)} of the cases here have no row with a reference.")
    if lost:
        found.append(f"{lost} rows were lost to a time limit or a crash; they count as failures.")
    return found
