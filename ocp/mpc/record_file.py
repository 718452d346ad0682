"""A flight record: a line that says whose it is, then a framed record for every step."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO

from ocp.checks.arguments import check_instance
from ocp.checks.errors import DamagedFile
from ocp.files.archive import named
from ocp.files.checksum import CHECKSUM, with_checksum, without_checksum
from ocp.files.frame import BrokenFrame, read_frames, whole_frames
from ocp.mpc.record_format import CODES, HEAD, Codes, Record, size_of, unpacked

_FORMAT = "flight record, version 4"
# It has no checksums, no frames, and does not say what its codes stand for.
_UNCHECKED = "flight record, version 3"
_CODES_THEN = Codes(
    (None, "OPTIMAL", "FEASIBLE", "SHIFTED", "BACKUP", "LEAST_VIOLATING"),
    (
        None, "SOLVED", "STATIONARY", "MYOPIC", "SMALL_DECREASE", "COST_ROSE", "ITERATION_LIMIT",
        "TIME_LIMIT", "NO_PROGRESS", "DIVERGED", "INACCURATE", "INFEASIBLE", "FAILED",
    ),
    (None, "held", "linear", "polynomial", "extremal"),
)  # fmt: skip


@dataclass(frozen=True)
class Header:
    """What the first line of a file says.

    Attributes:
        problem: its name.
        solver: as text.
        parameters: their names, in the order of a record.
        acting: what acted before the first decision (m,); None: unknown.
        codes: what bytes of a record stand for.
        is_checked: whether the records have checksums.
    """

    problem: str
    solver: str
    parameters: tuple[str, ...]
    acting: Sequence[float] | None
    codes: Codes = CODES
    is_checked: bool = True

    @property
    def line(self) -> bytes:
        """The first line."""
        said = {"format": _FORMAT, **asdict(self)}
        return json.dumps(with_checksum(said)).encode() + b"\n"


def read_header(path: str | Path) -> Header:
    """Return what the first line of a file says.

    Raises:
        ProblemError: if it cannot be read.
        DamagedFile: if it is none of a flight record, or not as it was written.
    """
    check_instance(path, (str, Path), "the path of a flight record")
    with named(path, "flight record", "read"), Path(path).open("rb") as file:
        return _header(file, path)


def records(path: str | Path, *, salvage: bool = False) -> Iterator[Record]:
    """Yield the complete records of a file, in order; a last one that was cut off is left out.

    Args:
        path: a file that a ``FlightRecorder`` wrote.
        salvage: yield what is whole, and leave out what is damaged or missing in between; where
            the first line is damaged, the parameters are called "0", "1", ...

    Raises:
        ProblemError: if it cannot be read.
        DamagedFile: at the first record that is damaged or missing; and if it is no flight
            record. Files of version 3 have no checksums: what makes sense in them is believed.
    """
    check_instance(path, (str, Path), "the path of a flight record")
    with named(path, "flight record", "read"), Path(path).open("rb") as file:
        yield from _salvaged(file, path) if salvage else _records(file, path)


def _header(file: BinaryIO, path: str | Path) -> Header:
    try:
        said = json.loads(file.readline())
        if said["format"] not in (_FORMAT, _UNCHECKED):
            raise ValueError(f"its format is '{said['format']}'")
        return _header_of(said)
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError) as reason:
        raise DamagedFile(
            f"{path} is no {_FORMAT}, its first line is damaged or another: {reason}. If it was "
            "one, records(path, salvage=True) yields the steps that are whole"
        ) from reason


def _header_of(said: dict[str, Any]) -> Header:
    is_checked = said["format"] == _FORMAT
    if is_checked and CHECKSUM not in said:
        raise ValueError("it has no checksum")
    said = without_checksum(said)
    names = [said["problem"], said["solver"], *said["parameters"]]
    if not all(isinstance(name, str) for name in names):
        raise TypeError("a name in it is no text")
    codes = Codes(**said["codes"]) if is_checked else _CODES_THEN
    return Header(names[0], names[1], tuple(names[2:]), said["acting"], codes, is_checked)


def _records(file: BinaryIO, path: str | Path) -> Iterator[Record]:
    said, number = _header(file, path), 0
    try:
        for record in read_frames(file) if said.is_checked else _unframed(file):
            yield unpacked(record, said.parameters, said.codes)
            number += 1
    except BrokenFrame as reason:
        after = sum(k > number for k, _ in whole_frames(Path(path).read_bytes()))
        raise DamagedFile(
            f"{path} is damaged in step {number}, at byte {reason.at}: {reason}. The {number} "
            f"steps before and {after} after it are whole: records(path, salvage=True) yields them"
        ) from reason
    except ValueError as reason:
        raise DamagedFile(f"{path} is damaged in step {number}: {reason}") from reason


def _unframed(file: BinaryIO) -> Iterator[bytes]:
    """Yield the records of a file that has no frames."""
    while len(head := file.read(HEAD.size)) == HEAD.size:
        body = file.read(size_of(head))
        if len(body) < size_of(head):
            return
        yield head + body


def _salvaged(file: BinaryIO, path: str | Path) -> Iterator[Record]:
    names, codes = None, CODES
    try:
        said = _header(file, path)
        names, codes = said.parameters, said.codes
    except DamagedFile:
        file.seek(0)
    for _, record in whole_frames(file.read()):
        yield unpacked(record, names, codes)
