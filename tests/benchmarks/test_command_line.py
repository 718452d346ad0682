"""The command line, as a stranger types it."""

from pathlib import Path

import pytest

from benchmarks.__main__ import main
from benchmarks.cases import all_cases
from benchmarks.commands.bench import BENCH_CASES, BENCH_METHODS
from benchmarks.methods.every import all_methods
from benchmarks.pictures.main_job import bench_picture
from benchmarks.pictures.rooms import rooms
from benchmarks.sweep.row import RESULTS

ROOT = Path(__file__).parents[2]


def test_list_names_every_suite_and_solver(capsys):
    assert main(["list"]) == 0
    shown = capsys.readouterr().out
    for name in {case.suite for case in all_cases()} | {m.name for m in all_methods()}:
        assert name in shown


def test_run_prints_a_table_and_returns_0_where_all_claims_hold(tmp_path, capsys):
    arguments = ["run", "--case", "van-der-pol", "--solver", "direct-coarse", "extremal"]
    assert main([*arguments, "--workers", "1", "--starts", "1", "--out", str(tmp_path)]) == 0
    assert "extremal" in capsys.readouterr().out
    assert (tmp_path / RESULTS).exists()


def test_bench_names_cases_and_methods_that_exist():
    assert set(BENCH_CASES) <= {case.name for case in all_cases()}
    assert set(BENCH_METHODS) <= {method.name for method in all_methods()}


def test_rooms_are_those_of_the_packages(tmp_path, capsys):
    assert main(["rooms", "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    for package in ("ocp", "solvers", "benchmarks"):
        folders = {p.parent.name for p in ROOT.joinpath(package).glob("*/__init__.py")}
        assert folders <= {room.name for room in rooms() if room.package == package}
    assert all(room.about and room.name in shown for room in rooms())
    assert (tmp_path / "rooms.png").read_bytes().startswith(b"\x89PNG")


def test_nothing_to_run_is_said_and_is_no_success(tmp_path, capsys):
    arguments = ["run", "--case", "bryson-denham", "--solver", "polish", "--out", str(tmp_path)]
    assert main(arguments) == 2
    assert "nothing to run" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "--case", "no-such-case"],
        ["run", "--solver", "no-such-solver"],
        ["run", "--suite", "no-such-suite"],
        ["run", "--workers", "0"],
        ["run", "--starts", "none"],
        ["unknown"],
        [],
    ],
)
def test_bad_words_end_with_a_message(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert capsys.readouterr().err


@pytest.mark.slow
def test_the_picture_is_drawn(tmp_path):
    file = bench_picture("arm-003-sum", tmp_path)
    assert file.read_bytes().startswith(b"\x89PNG")
    assert file.stat().st_size > 50_000
