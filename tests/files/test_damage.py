"""One flipped bit, or a lost end: never another value, never another error than the named one."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.sweep.rows_file import read_found
from ocp import Compiler, DamagedFile, ProblemError, Solution, records, whole_arrays
from ocp.codegen.compile import compiled
from ocp.codegen.kept_library import keep_library, kept_library
from ocp.files.frame import whole_frames
from tests.files.examples import KINDS, STEPS, Kind, function, problem, record, same, solution

FLIPS = [300, pytest.param(10_000, marks=pytest.mark.slow)]
CUTS = [60, pytest.param(1_000, marks=pytest.mark.slow)]
needs_compiler = pytest.mark.skipif(not Compiler().found, reason="no compiler on this machine")


def flipped(content: bytes, bit: int) -> bytes:
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def is_right(kind: Kind, file: Path, whole: Any) -> bool:
    """Whether what is read is what was written, or a part of it, or the error of its kind."""
    try:
        found = kind.read(file)
    except kind.error as error:
        return file.name in str(error)
    if kind.in_parts:
        return all(any(same(one, other) for other in whole) for one in found)
    return same(found, whole)


@pytest.fixture(params=KINDS)
def example(request, tmp_path) -> tuple[Kind, Path, bytes, Any]:
    kind, file = KINDS[request.param], tmp_path / request.param
    kind.write(file)
    whole = kind.read(file)
    assert same(kind.read(file), whole)
    return kind, file, file.read_bytes(), whole


@pytest.mark.many
@pytest.mark.parametrize("number", FLIPS)
def test_a_flipped_bit_is_never_another_value(example, number):
    kind, file, content, whole = example
    rng = np.random.default_rng(number)
    for bit in rng.integers(8 * len(content), size=number):
        file.write_bytes(flipped(content, int(bit)))
        assert is_right(kind, file, whole), f"bit {bit}"


def test_a_row_that_is_not_read_is_spoken_of(tmp_path):
    file = tmp_path / "results.jsonl"
    KINDS[file.name].write(file)
    content, whole = file.read_bytes(), read_found(file)
    rng = np.random.default_rng(0)
    for bit in rng.integers(8 * len(content), size=300):
        file.write_bytes(flipped(content, int(bit)))
        found = read_found(file)
        assert found == whole or found.notes(file), f"bit {bit}"
        assert not found.foreign, "damage is no other version"


@pytest.mark.parametrize("number", CUTS)
def test_a_lost_end_is_never_another_value(example, number):
    kind, file, content, whole = example
    rng = np.random.default_rng(number)
    for length in rng.integers(len(content), size=number):
        file.write_bytes(content[:length])
        assert is_right(kind, file, whole), f"{length} bytes"


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize(
    "content",
    [
        b"", b"\n", b"\0" * 5000, b"once upon a time\n", b"{}\n", b"[1, 2]\n", b"null\n", b"3\n",
        b'{"format": 2, "cases": {"x": 3}}', b'{"format": "flight record, version 4"}\n',
        b'{"format": "flight record, version 3", "problem": 1, "solver": 2, "parameters": 3}\n',
        b'{"format": "flight record, version 2"}\n', b"[" * 100_000, b"\xff\xfe\n",
        b'{"version": 1, "entries": 4}', b"PK\x03\x04", b"PK\x05\x06" + b"\0" * 18,
        b"PK\x03\x04" + b"\xff" * 40 + b"PK\x05\x06" + b"\0" * 18, b"\x93NUMPY\x01\x00",
    ],
    ids=lambda content: repr(content[:30]),
)  # fmt: skip
def test_another_kind_of_file_is_named(tmp_path, name, content):
    kind, file = KINDS[name], tmp_path / name
    file.write_bytes(content)
    if kind.in_parts and name != "flight":
        assert kind.read(file) == ()
        return
    with pytest.raises(kind.error, match=name):
        kind.read(file)


@pytest.mark.parametrize("number", [200, pytest.param(5_000, marks=pytest.mark.slow)])
def test_what_is_salvaged_was_written(tmp_path, number):
    file = tmp_path / "flight"
    record(file)
    content, whole = file.read_bytes(), list(records(file))
    path = solution().save(tmp_path / "s")
    archive, arrays = path.read_bytes(), whole_arrays(path)
    with np.load(path) as kept:
        assert same(dict(kept), arrays)
    rng = np.random.default_rng(number)
    for _ in range(number):
        file.write_bytes(flipped(content, int(rng.integers(8 * len(content)))))
        found = list(records(file, salvage=True))
        assert len(found) >= STEPS - 1
        assert all(any(same(one, other) for other in whole) for one in found)
        path.write_bytes(flipped(archive, int(rng.integers(8 * len(archive)))))
        left = whole_arrays(path)
        assert len(left) >= len(arrays) - 1
        assert all(same(arrays[name], array) for name, array in left.items())


def test_damage_says_where_and_what_is_left(tmp_path):
    file = tmp_path / "flight"
    record(file)
    content = file.read_bytes()
    size = (len(content) - content.index(b"\n") - 1) // STEPS
    at = len(content) - 3 * size
    file.write_bytes(flipped(content, 8 * (at + size // 2)))
    said = (
        rf"flight is damaged in step 3, at byte {at}: the checksum does not fit. The 3 steps "
        r"before and 2 after it are whole: records\(path, salvage=True\) yields them"
    )
    with pytest.raises(DamagedFile, match=said):
        list(records(file))
    found = records(file)
    assert [next(found).measured[0] for _ in range(3)] == [0, 1, 2]
    assert [step.measured[0] for step in records(file, salvage=True)] == [0, 1, 2, 4, 5]
    file.write_bytes(content[:at] + content[at + size :])
    with pytest.raises(DamagedFile, match="record 4 follows record 2"):
        list(records(file))
    file.write_bytes(content[:-size] + content[-size - 1 :])
    with pytest.raises(DamagedFile, match="there is no record"):
        list(records(file))
    assert len(list(records(file, salvage=True))) == STEPS


def test_a_damaged_archive_says_what_is_left(tmp_path):
    path = solution().save(tmp_path / "s")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    said = r"s\.npz is no saved solution: it is damaged or cut off.* \d+ of its arrays are whole"
    with pytest.raises(DamagedFile, match=said):
        Solution.load(path, problem())
    assert set(whole_arrays(path)) < {*np.load(solution().save(tmp_path / "t")).files}


@pytest.mark.parametrize(
    "changes",
    [
        {"t": np.array(3.0)},
        {"x": np.array(["a", "b"])},
        {"cost": np.array("dear")},
        {"iterations": np.array([1, 2])},
        {"work/rollouts": np.array("many")},
        {"work/unheard": np.array(1)},
        {"unheard/of": np.array(1)},
        {"status": np.array("PERFECT")},
        {"breaks": np.array(["a"])},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_an_archive_of_wrong_entries_is_no_solution(tmp_path, changes):
    path = solution().save(tmp_path / "s")
    with np.load(path) as file:
        content = {**dict(file), **changes}
    np.savez(path, **content)  # as older versions wrote it, without a checksum
    with pytest.raises(DamagedFile, match="no saved solution"):
        Solution.load(path, problem())


def test_an_archive_of_before_is_read(tmp_path):
    path = solution().save(tmp_path / "s")
    with np.load(path) as file:
        content = dict(file)
    np.savez_compressed(path, **content)
    assert same(Solution.load(path, problem()), solution().with_(breaks=np.empty(0, dtype=int)))


@needs_compiler
@pytest.mark.parametrize("number", FLIPS)
def test_a_damaged_library_is_not_loaded(tmp_path, number):
    compiled(function(0), compiler=Compiler(cache=tmp_path, flags=("-O0",)))
    (library,) = tmp_path.iterdir()
    content, key = library.read_bytes(), library.name.partition("-")[0]
    rng = np.random.default_rng(number)
    damaged = [flipped(content, int(bit)) for bit in rng.integers(8 * len(content), size=number)]
    damaged += [content[:length] for length in rng.integers(len(content), size=number // 10)]
    for swapped in damaged:
        library.write_bytes(swapped)
        library.chmod(0o700)
        assert kept_library(tmp_path, key, library.suffix) is None
        assert not library.exists()
    built = tmp_path / f"built{library.suffix}"
    built.write_bytes(content)
    assert keep_library(built, tmp_path / key) == library
    assert kept_library(tmp_path, key, library.suffix) == library


def test_a_flight_record_of_before_is_read(tmp_path):
    """Version 3 has no frames, no checksums, and says less in its first line."""
    file = tmp_path / "flight"
    record(file)
    whole = list(records(file))
    first, rest = file.read_bytes().split(b"\n", 1)
    said = json.loads(first)
    old = {name: said[name] for name in ("problem", "solver", "parameters", "acting")}
    line = json.dumps({"format": "flight record, version 3", **old}).encode()
    unframed = b"".join(packed for _, packed in whole_frames(rest))
    file.write_bytes(line + b"\n" + unframed + unframed[:50])
    assert same(list(records(file)), whole)
    file.write_bytes(line + b"\n" + unframed[:44] + b"\xff" + unframed[45:])
    with pytest.raises(DamagedFile, match=r"flight is damaged in step 0: these bytes are no step"):
        list(records(file))


@pytest.mark.parametrize("path", ["a\0b", "\ud800"])
def test_a_name_that_no_file_can_have_is_refused(path):
    with pytest.raises(ProblemError, match="no file has the name"):
        solution().save(path)
    with pytest.raises(ProblemError, match="no file has the name"):
        Solution.load(path, problem())
    with pytest.raises(ProblemError, match="no file has the name"):
        list(records(path))
