"""What was run, where, when, and with which versions."""

from collections import Counter
from collections.abc import Sequence

from benchmarks.methods.every import all_methods
from benchmarks.report.section import Block, Section, Text
from benchmarks.report.sheet import Sheet
from benchmarks.sweep.row import Row


def overview(rows: Sequence[Row]) -> Section:
    """Return the first section."""
    return Section("run", "What was run where", [*_places(rows), _suites(rows), _methods(rows)])


def _places(rows: Sequence[Row]) -> list[Block]:
    places = Counter((tuple(row.machine.items()), tuple(row.versions.items())) for row in rows)
    machines = [dict((*machine, *versions)) for machine, versions in places]
    names = list(dict.fromkeys(name for machine in machines for name in machine))
    lines = [[name, *(machine.get(name) for machine in machines)] for name in names]
    lines.append(["rows", *map(str, places.values())])
    titles = ["here"] if len(machines) == 1 else [f"place {i + 1}" for i in range(len(machines))]
    when = sorted(row.when for row in rows)
    span = f"The rows were computed from {_minute(when[0])} to {_minute(when[-1])} (UTC)."
    return [Text(span), Sheet("places", ["what", *titles], lines)]


def _minute(when: str) -> str:
    return when[:16].replace("T", " ")


def _suites(rows: Sequence[Row]) -> Sheet:
    columns = ("suite", "rows", "cases", "with a reference", "methods", "starts", "seeds", "lost")
    lines = []
    for suite in dict.fromkeys(row.suite for row in rows):
        here = [row for row in rows if row.suite == suite]
        known = {row.case for row in here if row.reference is not None}
        lines.append(
            [
                suite,
                len(here),
                len({row.case for row in here}),
                len(known),
                len({row.solver for row in here}),
                _listed({row.starts for row in here}),
                _listed({row.seed for row in here}),
                sum(row.is_lost for row in here),
            ]
        )
    return Sheet("suites", columns, lines)


def _listed(numbers: set[int]) -> str:
    return ", ".join(map(str, sorted(numbers)))


def _methods(rows: Sequence[Row]) -> Sheet:
    """What each is, and where it begins: what another method did before is not in its time."""
    about = {method.name: method.about for method in all_methods()}
    options = dict.fromkeys((row.solver, row.settings) for row in rows)
    lines = [(name, about.get(name), settings) for name, settings in options]
    return Sheet("methods", ("method", "in short", "its options"), lines, folded=True)
