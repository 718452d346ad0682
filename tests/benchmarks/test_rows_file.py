"""A results folder from elsewhere: everything in it is kept, and what cannot be used is named."""

import json

import pytest

from benchmarks.methods.method import Settings
from benchmarks.sweep.row import CRASHED, RESULTS, OtherVersion, Row
from benchmarks.sweep.rows_file import mend, prepare, read_found, read_rows
from benchmarks.sweep.task import SweepTask
from ocp.internal import with_checksum, without_checksum


def lost(case: str) -> Row:
    return Row.lost(
        SweepTask("textbook", case, "direct-75", "", Settings()), CRASHED, "a test", 1.0
    )


def changed(**changes: object) -> str:
    """A line that somebody has written so, with the checksum that belongs to it."""
    entry = without_checksum(json.loads(lost("changed").line()))
    return json.dumps(with_checksum({**entry, **changes})) + "\n"


@pytest.fixture
def file(tmp_path):
    lost("one").append_to(tmp_path / RESULTS)
    return tmp_path / RESULTS


def test_a_row_comes_back_as_it_was(file):
    (row,) = read_rows(file)
    assert (row.case, row.status, row.solve_time) == ("one", CRASHED, 1.0)
    assert prepare(file) == []


@pytest.mark.parametrize(
    ("damage", "why"),
    [
        (b"not json at all\n", "Expecting value"),
        (b'{"suite": "textbook", "ca', "Unterminated"),
        (b"{}\n", "it has no build_time, no case, no controls ..."),
        (b"[1, 2]\n", "a list, no object"),
        (b"\xff\xfe\n", "can't decode"),
        (b"\x00\x00\x00\n", "Expecting value"),
        (b"[" * 100_000 + b"\n", ""),
        (changed(cost="cheap").encode(), "its cost is 'cheap'"),
        (changed(seed=True).encode(), "its seed is True"),
        (changed(versions={"casadi": 3}).encode(), "its versions is {'casadi': 3}"),
        (changed(cost=0.5).replace("0.5", "NaN").encode(), "NaN is no number"),
    ],
)
def test_a_corrupt_line_is_named_and_stays(file, damage, why):
    with file.open("ab") as end:
        end.write(damage)
    before = file.read_bytes()
    (note,) = prepare(file)
    assert note.startswith(f"line 2 of {RESULTS} is no row: ")
    assert why in note
    assert file.read_bytes().startswith(before)
    lost("two").append_to(file)
    assert [row.case for row in read_rows(file)] == ["one", "two"]


def test_rows_of_other_versions_are_set_aside(file):
    with file.open("a") as end:
        end.write(changed(versions={**lost("").versions, "casadi": "3.5"}))
        end.write("torn")
    before = file.read_bytes()
    notes = prepare(file)
    assert "line 3" in notes[0]
    assert notes[1].startswith(f"1 rows of {RESULTS} are of other versions: casadi 3.5 (here ")
    assert notes[2] == "the file as it was is kept as results-old-1.jsonl"
    assert file.with_name("results-old-1.jsonl").read_bytes() == before + b"\n"
    assert [row.case for row in read_rows(file)] == ["one"]
    assert prepare(file) == []


def test_a_second_old_file_gets_another_name(file):
    for number in (1, 2):
        with file.open("a") as end:
            end.write(changed(unheard="of"))
        found = read_found(file)
        assert found.foreign == ((2, "it has an unknown unheard"),)
        prepare(file)
        assert file.with_name(f"results-old-{number}.jsonl").exists()
    assert [row.case for row in read_rows(file)] == ["one"]


def test_another_format_is_told_from_damage():
    with pytest.raises(OtherVersion, match="no when"):
        Row.parse(changed_without("when"))


def changed_without(name: str) -> str:
    """A line of a version that had no checksums."""
    entry = without_checksum(json.loads(changed()))
    return json.dumps({k: v for k, v in entry.items() if k != name})


def test_lines_without_a_checksum_are_rows_of_before(file):
    with file.open("a") as end:
        end.write(changed_without("") + "\n")
    assert [row.case for row in read_rows(file)] == ["one", "changed"]


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"cost": 10**400}, "its cost is 1000"),
        ({"suite": "\ud800"}, "its suite is '\\ud800'"),
        ({"machine": {"\ud800": "here"}}, "its machine is"),
    ],
)
def test_what_no_page_can_show_is_no_row(file, changes, why):
    with file.open("a") as end:
        end.write(changed(**changes))
    ((number, said),) = read_found(file).corrupt
    assert number == 2
    assert said.startswith(why)


def test_a_message_with_bytes_that_are_no_text_is_written():
    row = Row.lost(SweepTask("a", "b", "c", "", Settings()), CRASHED, "file \udcff", 1.0)
    assert Row.parse(row.line()).message == "file ?"


def test_nothing_to_read_is_no_row(tmp_path):
    file = tmp_path / RESULTS
    mend(file)
    assert prepare(file) == []
    assert read_rows(file) == ()
    file.touch()
    assert read_rows(file) == ()
