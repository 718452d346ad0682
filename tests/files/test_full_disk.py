"""A disk that is full, writes that are short: the file of before stays, and a sentence is said."""

import os
from collections.abc import Callable
from errno import ENOSPC
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from benchmarks.sweep.error import SweepError
from benchmarks.sweep.rows_file import read_rows
from benchmarks.sweep.sweep import _write
from ocp import DamagedFile, FlightRecorder, ProblemError, records
from ocp.files.append import append_line
from ocp.files.draft import draft_folder, replacing, write_file
from tests.files.examples import KINDS, append_rows, controller, decision, row, same

WHOLE = {name: kind for name, kind in KINDS.items() if not kind.in_parts}


def full_after(size: int) -> Callable[[int, bytes], int]:
    """A disk that has room for so many bytes, and takes 1000 at a time."""
    room = size

    def write(descriptor: int, content: bytes) -> int:
        nonlocal room
        if not room:
            raise OSError(ENOSPC, os.strerror(ENOSPC))
        taken = min(room, 1000, len(content))
        room -= taken
        return REAL(descriptor, content[:taken])

    return write


REAL = os.write


@pytest.mark.parametrize("name", WHOLE)
@pytest.mark.parametrize("size", [0, 1, 50, 100])
def test_the_old_file_stays(tmp_path, monkeypatch, name, size):
    kind, file = WHOLE[name], tmp_path / name
    kind.write(file)
    before = file.read_bytes()
    monkeypatch.setattr("os.write", full_after(size))
    with pytest.raises((ProblemError, OSError), match="No space left on device"):
        kind.write(file)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("name", KINDS)
def test_short_writes_are_gone_on_with(tmp_path, monkeypatch, name):
    kind = KINDS[name]
    kind.write(tmp_path / name)
    monkeypatch.setattr("os.write", lambda to, content: REAL(to, content[: 1 + len(content) // 3]))
    kind.write(tmp_path / f"short-{name}")
    assert same(kind.read(tmp_path / name), kind.read(tmp_path / f"short-{name}"))


def write_rows(file: Path) -> None:
    for k in count(100):
        _write(row(k), file)


@pytest.mark.parametrize("size", [0, 1, 100, 1500])
def test_a_row_is_there_or_not(tmp_path, monkeypatch, size):
    file = tmp_path / "results.jsonl"
    append_rows(file)
    before = file.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr("os.write", full_after(size))
        with pytest.raises(SweepError, match=r"results\.jsonl cannot be written: No space left"):
            write_rows(file)
    assert file.read_bytes().startswith(before)
    assert file.read_bytes().endswith(b"\n")
    row(7).append_to(file)
    assert read_rows(file)[-1].case == "case 7"


def test_a_recorder_goes_on_when_there_is_room_again(tmp_path, monkeypatch):
    """Each failure is an OSError of its own; what is missing is said, and nothing is torn."""
    file = tmp_path / "flight"
    with FlightRecorder(controller(), file) as recorder:
        for k in range(6):
            with monkeypatch.context() as patch:
                if k in (2, 3):
                    patch.setattr("os.write", full_after(70))
                    with pytest.raises(OSError, match="No space left on device"):
                        recorder.watch(np.array([k, 0.5]), decision(k))
                else:
                    recorder.watch(np.array([k, 0.5]), decision(k))
    with pytest.raises(DamagedFile, match=r"in step 2, .*record 4 follows record 1.*2 after it"):
        list(records(file))
    assert [step.measured[0] for step in records(file, salvage=True)] == [0, 1, 4, 5]


def test_a_recorder_that_cannot_begin_leaves_the_file_of_before(tmp_path, monkeypatch):
    file = tmp_path / "flight"
    KINDS["flight"].write(file)
    before = file.read_bytes()
    with FlightRecorder(controller(), file) as recorder:
        assert file.read_bytes() == before
        with monkeypatch.context() as patch:
            patch.setattr("os.write", full_after(20))
            with pytest.raises(OSError, match="No space left on device"):
                recorder.watch(np.zeros(2), decision(0))
        assert file.read_bytes() == before
        recorder.watch(np.ones(2), decision(1))
    assert [step.measured[0] for step in records(file, salvage=True)] == [1.0]


def interrupted(file: Path) -> None:
    with replacing(file) as draft:
        assert draft.name == file.name
        draft.write_bytes(b"half")
        raise KeyboardInterrupt


def test_an_error_inside_leaves_the_file_of_before(tmp_path):
    file = tmp_path / "picture.png"
    write_file(file, b"old")
    with pytest.raises(KeyboardInterrupt):
        interrupted(file)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_a_file_keeps_its_permissions_and_its_link(tmp_path):
    file, link = tmp_path / "file", tmp_path / "link"
    write_file(file, b"one")
    umask = os.umask(0)
    os.umask(umask)
    assert file.stat().st_mode & 0o777 == 0o666 & ~umask
    file.chmod(0o640)
    link.symlink_to(file)
    write_file(link, b"two")
    assert link.is_symlink()
    assert file.read_bytes() == b"two"
    assert file.stat().st_mode & 0o777 == 0o640


@pytest.mark.skipif(os.name != "posix", reason="a device of Unix")
def test_a_device_is_written_and_not_replaced():
    write_file("/dev/null", b"nothing")
    assert not Path("/dev/null").is_file()
    with pytest.raises(IsADirectoryError):
        write_file("/", b"nothing")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everything")
def test_a_protected_file_is_not_replaced(tmp_path):
    file = tmp_path / "file"
    write_file(file, b"old")
    file.chmod(0o444)
    with pytest.raises(PermissionError):
        write_file(file, b"new")


def test_drafts_of_the_living_stay_and_those_of_the_dead_go(tmp_path):
    dead = tmp_path / ".ocp-0123456789abcdef.draft"
    dead.mkdir()
    (dead / "file").write_bytes(b"half")
    with draft_folder(tmp_path) as one, draft_folder(tmp_path) as other:
        assert sorted(tmp_path.iterdir()) == sorted([one, other])
    assert not list(tmp_path.iterdir())


def test_a_torn_line_is_ended_first(tmp_path):
    file = tmp_path / "lines"
    file.write_bytes(b"whole\ntorn")
    append_line(file, b"next\n")
    assert file.read_bytes() == b"whole\ntorn\nnext\n"
