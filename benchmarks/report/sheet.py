"""Numbers as a table that can be read, and as a file that can be taken away."""

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote

Cell = str | int | float | bool | None

# A spreadsheet takes text that begins so for a formula, also in full width, unless it is a number.
_FORMULA = re.compile(r"\s*[=+\-@\t\r\n\uff1d\uff0b\uff0d\uff20]")
_NUMBER = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?")
# What a page shows of a long table; its file has everything.
SHOWN = 200


@dataclass(frozen=True)
class Sheet:
    """A table.

    Attributes:
        name: of its file, without ending.
        columns: their titles, with units.
        lines: as many cells each; None where a thing does not exist.
        folded: shown only when asked for.
    """

    name: str
    columns: Sequence[str]
    lines: Sequence[Sequence[Cell]]
    folded: bool = False
    kind = "sheet"

    @property
    def shown(self) -> list[list[tuple[str, bool, Cell]]]:
        """Cells as (text, whether it is a number, share in % to draw a bar for or None)."""
        return [
            [
                (text_of(cell), is_number(cell), cell if title.endswith("[%]") else None)
                for title, cell in zip(self.columns, line, strict=True)
            ]
            for line in self.lines[:SHOWN]
        ]

    @property
    def titles(self) -> list[tuple[str, bool]]:
        """Titles, each with whether numbers stand below it."""
        cells = [[line[i] for line in self.lines] for i in range(len(self.columns))]
        numeric = [any(map(is_number, column)) for column in cells]
        return list(zip(self.columns, numeric, strict=True))

    @property
    def left_out(self) -> int:
        """Lines that only the file has."""
        return max(len(self.lines) - SHOWN, 0)

    @property
    def csv(self) -> str:
        """The table with all digits, as comma-separated values, none of which is a formula."""
        text = io.StringIO()
        # What stands in the end of a line is quoted in cells: a bare CR would begin a line too.
        writer = csv.writer(text, lineterminator="\r\n")
        writer.writerows([*map(_inert, line)] for line in (self.columns, *self.lines))
        return text.getvalue()

    @property
    def address(self) -> str:
        """The file as an address that needs no network."""
        return "data:text/csv;charset=utf-8," + quote(self.csv)


def _inert(cell: Cell) -> Cell:
    """Return a cell as a spreadsheet shows it, text behind an apostrophe where it would compute."""
    if isinstance(cell, str) and _FORMULA.match(cell) and not _NUMBER.fullmatch(cell):
        return f"'{cell}"
    return cell


def is_number(cell: Cell) -> bool:
    """Whether a cell is written to the right."""
    return isinstance(cell, int | float) and not isinstance(cell, bool)


def text_of(cell: Cell) -> str:
    """Return a cell as a person reads it, four digits at most."""
    if cell is None:
        return "–"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, float):
        return re.sub(r"e([+-])0", r"e\1", f"{cell:.3g}")
    return str(cell)
