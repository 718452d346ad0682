"""The file of a results folder: lines are only ever added, and every bad one is spoken of."""

import os
from collections import Counter
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from benchmarks.sweep.row import OtherVersion, Row, versions
from ocp.internal import append_line, write_file


@dataclass(frozen=True)
class ReadRows:
    """What a file holds.

    Attributes:
        rows: the newest row of each key.
        foreign: line numbers, and why, of rows that another version of the format has.
        corrupt: line numbers, and why, of what is no row.
    """

    rows: tuple[Row, ...] = ()
    foreign: tuple[tuple[int, str], ...] = ()
    corrupt: tuple[tuple[int, str], ...] = ()

    def notes(self, file: Path) -> list[str]:
        """Return a sentence for every line that is no row of this version."""
        notes = [f"line {n} of {file.name} is no row: {why}" for n, why in self.corrupt]
        for why, number in Counter(why for _, why in self.foreign).items():
            notes.append(f"{number} rows of {file.name} are of another version: {why}")
        return notes


def read_found(file: Path) -> ReadRows:
    """Read a file; no file: nothing is found."""
    if not file.exists():
        return ReadRows()
    rows, foreign, corrupt = {}, [], []
    lines = file.read_bytes().split(b"\n")
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            row = Row.parse(line.decode())
        except OtherVersion as other:
            foreign.append((number, str(other)))
        except ValueError as wrong:  # of JSON and of UTF-8 too
            corrupt.append((number, str(wrong)))
        else:
            rows[row.key] = row
    return ReadRows(tuple(rows.values()), tuple(foreign), tuple(corrupt))


def read_rows(file: Path) -> tuple[Row, ...]:
    """Return the rows of a file, the newest of each key, without what is no row."""
    return read_found(file).rows


def mend(file: Path) -> None:
    """End a torn last line, so that the next row starts on a line of its own."""
    if file.exists() and file.stat().st_size and not file.read_bytes().endswith(b"\n"):
        append_line(file, b"")


def prepare(file: Path) -> list[str]:
    """Make a file ready for rows of this version; return what is to be said about it.

    A line that is no row stays where it is. Rows of other versions are set aside: the whole file
    is kept under another name, and only what is of this version goes on.
    """
    mend(file)
    found = read_found(file)
    notes = found.notes(file)
    here = tuple(row for row in found.rows if row.versions == versions())
    others = Counter(_difference(row) for row in found.rows if row.versions != versions())
    for difference, number in others.items():
        notes.append(f"{number} rows of {file.name} are of other versions: {difference}")
    if others or found.foreign:
        notes.append(f"the file as it was is kept as {_set_aside(file, here).name}")
    return notes


def _difference(row: Row) -> str:
    """Say in what the versions of a row differ from those here."""
    names = sorted(row.versions.keys() | versions().keys())
    pairs = [(name, row.versions.get(name, "none"), versions().get(name)) for name in names]
    return ", ".join(f"{name} {old} (here {new})" for name, old, new in pairs if old != new)


def _set_aside(file: Path, rows: tuple[Row, ...]) -> Path:
    """Keep a file under a new name and leave these rows in its place; a kill loses nothing."""
    names = (file.with_name(f"{file.stem}-old-{i}{file.suffix}") for i in count(1))
    kept = next(name for name in names if not name.exists())
    os.link(file, kept)
    write_file(file, "".join(row.line() for row in rows).encode())
    return kept
