"""The rows as the sections ask for them."""

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.sweep.row import Row

TICK = 1e-6  # [s]
# Suites whose cases come with either distance cost, which differ in how hard they are.
_KINDS = {"arm": ("sum", "closest"), "comparison": ("closest", "sum")}


@dataclass(frozen=True)
class Part:
    """Rows that belong in one plot.

    Attributes:
        title: the suite, and which of its cases.
        name: the same without spaces.
        rows: all of them.
        colours: the number of each method's colour, the same in the whole report.
    """

    title: str
    rows: tuple[Row, ...]
    colours: dict[str, int]

    @property
    def name(self) -> str:
        """The title, fit for an address."""
        return self.title.replace(" ", "-")

    @property
    def methods(self) -> tuple[str, ...]:
        """Names in the order of their first row."""
        return tuple(dict.fromkeys(row.solver for row in self.rows))

    def of(self, method: str) -> tuple[Row, ...]:
        """Return the rows of a method."""
        return tuple(row for row in self.rows if row.solver == method)


def parts_of(rows: Sequence[Row]) -> tuple[Part, ...]:
    """Return the rows suite by suite, and within it by the kind of cost."""
    colours = {name: i for i, name in enumerate(dict.fromkeys(row.solver for row in rows))}
    parts = []
    for suite in dict.fromkeys(row.suite for row in rows):
        members = [row for row in rows if row.suite == suite]
        for kind in _KINDS.get(suite, ("",)):
            here = tuple(row for row in members if row.case.endswith(kind))
            if here:
                parts.append(Part(f"{suite} {kind}".strip(), here, colours))
    return tuple(parts)


def time_of(row: Row) -> float:
    """Return the time of a solve [s]; what is too short for the clock is one tick of it."""
    return max(row.solve_time, TICK)
