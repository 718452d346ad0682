"""The rows as the sections ask for them."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import count

from benchmarks.sweep.row import Row

TICK = 1e-6  # [s]
# Suites whose cases come with either distance cost, which differ in how hard they are.
_KINDS = {"arm": ("sum", "closest"), "comparison": ("closest", "sum")}


@dataclass(frozen=True)
class Part:
    """Rows that belong in one plot.

    Attributes:
        title: the suite, and which of its cases.
        name: the same in letters, digits and single hyphens: fit for an address, and no other's.
        rows: all of them.
        colours: the number of each method's colour, the same in the whole report.
    """

    title: str
    name: str
    rows: tuple[Row, ...]
    colours: dict[str, int]

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
    parts: list[Part] = []
    for suite in dict.fromkeys(row.suite for row in rows):
        members = [row for row in rows if row.suite == suite]
        for kind in _KINDS.get(suite, ("",)):
            here = tuple(row for row in members if row.case.endswith(kind))
            if here:
                title = f"{suite} {kind}".strip()
                name = _address(title, {part.name for part in parts})
                parts.append(Part(title, name, here, colours))
    return tuple(parts)


def _address(title: str, taken: Collection[str]) -> str:
    """Return a name of harmless characters; a suite may be called anything, as in a file."""
    plain = re.sub(r"[^A-Za-z0-9]+", "-", title).strip("-") or "suite"
    names = (plain if i == 1 else f"{plain}-{i}" for i in count(1))
    return next(name for name in names if name not in taken)


def time_of(row: Row) -> float:
    """Return the time of a solve [s]; what is too short for the clock is one tick of it."""
    return max(row.solve_time, TICK)
