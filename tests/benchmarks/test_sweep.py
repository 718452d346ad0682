"""The sweep: rows as they are promised, nothing lost, nothing computed twice."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import asdict, replace
from datetime import datetime
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.cases import all_cases, arm_cases
from benchmarks.methods.every import all_methods
from benchmarks.methods.method import Settings
from benchmarks.sweep.error import SweepError
from benchmarks.sweep.guard import Group, run_group
from benchmarks.sweep.row import CRASHED, RESULTS, Row
from benchmarks.sweep.rows_file import read_rows
from benchmarks.sweep.sweep import sweep
from benchmarks.sweep.task import groups_of, tasks_of

PROMISED = {
    "suite", "case", "solver", "settings", "seed", "status", "solved", "cost", "reference", "gap",
    "violation", "stationarity", "iterations", "build_time", "solve_time", "versions", "machine",
}  # fmt: skip


def chosen(case_names, method_names):
    cases = [case for case in all_cases() if case.name in case_names]
    methods = [method for method in all_methods() if method.name in method_names]
    return tasks_of(cases, methods, Settings(starts=1))


QUICK = next(case for case in all_cases() if case.name == "double-integrator-energy")
# The first three methods that it declares.
DIRECT = [m.name for m in all_methods() if m.family == "direct" and QUICK.suite in m.suites][:3]
SMALL = chosen({QUICK.name}, DIRECT)


@pytest.fixture(scope="module")
def swept(tmp_path_factory) -> Path:
    """A folder with the finished sweep of the small tasks."""
    folder = tmp_path_factory.mktemp("swept")
    sweep(SMALL, folder, resume=False, progress=False)
    return folder


def first_line(swept: Path, folder: Path, then: str = "") -> Path:
    """Begin a file with the first row of a sweep."""
    file = folder / RESULTS
    file.write_text((swept / RESULTS).read_text().splitlines(keepends=True)[0] + then)
    return file


@pytest.mark.slow
def test_a_row_has_what_the_readme_promises(swept):
    rows = sweep(SMALL, swept, resume=True, progress=False)
    assert [(row.case, row.solver) for row in rows] == [(t.case, t.method) for t in SMALL]
    assert all(row.solved and row.optimum for row in rows)
    lines = (swept / RESULTS).read_text().splitlines()
    assert len(lines) == len(SMALL)
    assert all(set(json.loads(line)) >= PROMISED for line in lines)


def test_resume_recomputes_nothing_and_a_damaged_line_costs_its_row_only(tmp_path, swept):
    file = first_line(swept, tmp_path, '{"suite": "textbook", "ca')
    before, said = file.read_text(), []
    rows = sweep(SMALL, tmp_path, resume=True, progress=False, say=said.append)
    assert file.read_text().startswith(before)
    assert len(said) == 1
    assert "line 2" in said[0]
    assert len(rows) == len(read_rows(file)) == len(SMALL)
    assert len(file.read_text().splitlines()) == len(SMALL) + 1


@pytest.mark.slow
def test_without_resume_rows_are_computed_again_and_the_newest_counts(tmp_path, swept):
    file = first_line(swept, tmp_path)
    (old,) = read_rows(file)
    (row,) = sweep(SMALL[:1], tmp_path, resume=False, progress=False)
    assert len(file.read_text().splitlines()) == 2
    assert read_rows(file) == (row,)
    assert row != old


@pytest.mark.slow
def test_what_was_lost_is_computed_again_only_where_asked(tmp_path):
    lost = Row.lost(SMALL[0], CRASHED, "a test", 1.0)
    lost.append_to(tmp_path / RESULTS)
    assert sweep(SMALL[:1], tmp_path, resume=True, progress=False) == (lost,)
    (row,) = sweep(SMALL[:1], tmp_path, resume=True, retry=True, progress=False)
    assert row.solved


@pytest.mark.slow
def test_a_row_is_written_before_the_next_is_computed(tmp_path):
    """The second method never ends; the first one's row is in the file while it hangs."""
    told: list[Row] = []
    file = tmp_path / RESULTS

    def tell(row: Row) -> None:
        told.append(row)
        row.append_to(file)
        hanging.append(len(read_rows(file)))

    hanging: list[int] = []
    tasks = tuple(replace(SMALL[0], method=name) for name in ("good", "hangs"))
    rows = run_group(Group(tasks, 2.0, "tests.benchmarks.faulty_child"), tell)
    assert rows == told
    assert hanging == [1, 2]
    # UTC, in whole seconds: the second is lost when its limit of two seconds has passed.
    first, second = (datetime.fromisoformat(row.when) for row in rows)
    assert (second - first).total_seconds() >= 1.0


HOLDER = """
import sys, time
from pathlib import Path
from benchmarks.sweep.lock import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


def test_a_second_sweep_is_kept_out_until_the_first_is_dead(tmp_path, capsys):
    before = Row.lost(SMALL[0], CRASHED, "a test", 1.0)
    before.append_to(tmp_path / RESULTS)
    command = [sys.executable, "-c", HOLDER, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(SweepError, match=f"another sweep writes to .*process {holder.pid} on"):
            sweep(SMALL[:1], tmp_path, resume=False, progress=False)
        words = ["run", "--case", QUICK.name, "--solver", DIRECT[0], "--starts", "1", "--resume"]
        assert main([*words, "--out", str(tmp_path)]) == 2
        assert f"process {holder.pid} on" in capsys.readouterr().out
        holder.kill()
    assert sweep(SMALL[:1], tmp_path, resume=True, progress=False) == (before,)


def test_tasks_are_grouped_by_what_they_share():
    case = [case for case in all_cases() if case.name == "van-der-pol"]
    methods = [method for method in all_methods() if method.name in DIRECT]
    tasks = tasks_of(case, methods, Settings(1, 0), Settings(1, 1), Settings(2, 0))
    assert len({task.key for task in tasks}) == 9
    assert [len(group) for group in groups_of(tasks)] == [3, 3, 3]


KILLS = 10
SWEPT = [
    sys.executable, "-m", "benchmarks", "run", "--workers", "2",
    "--case", "van-der-pol", "double-integrator-energy",
    "--solver", *DIRECT, "--starts", "1",
]  # fmt: skip
ROWS = 6
TIMES = {"build_time", "solve_time", "when"}


def started(out: Path, *more: str) -> subprocess.Popen:
    command = [*SWEPT, "--out", str(out), *more]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)


def without_times(rows: tuple[Row, ...]) -> dict:
    return {row.key: {k: v for k, v in asdict(row).items() if k not in TIMES} for row in rows}


@pytest.mark.slow
def test_a_sweep_killed_ten_times_has_the_rows_of_an_undisturbed_one(tmp_path):
    """Driver and workers die at random moments; what they had written is never touched again."""
    begin = time.monotonic()
    assert started(tmp_path / "calm").wait() == 0
    whole = time.monotonic() - begin
    random = np.random.default_rng(0)
    kills, folders = 0, [tmp_path / "0"]
    while kills < KILLS:
        file = folders[-1] / RESULTS
        before = file.read_bytes() if file.exists() else b""
        process = started(folders[-1], "--resume")
        try:
            process.wait(timeout=random.uniform(0.0, 0.6 * whole))
        except subprocess.TimeoutExpired:
            kills += 1
            # The group: the driver, and the processes that compute.
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        else:  # it was quicker than its end: the next kills are for another sweep
            folders.append(tmp_path / str(len(folders)))
        assert not file.exists() or file.read_bytes().startswith(before)
    assert started(folders[-1], "--resume").wait() == 0
    calm = read_rows(tmp_path / "calm" / RESULTS)
    for folder in folders:
        rows = read_rows(folder / RESULTS)
        assert without_times(rows) == without_times(calm)
        assert len((folder / RESULTS).read_text().splitlines()) == len(rows) == ROWS


@pytest.mark.slow
def test_the_keyboard_ends_a_sweep_with_a_word(tmp_path):
    process = subprocess.Popen(
        [*SWEPT, "--out", str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # Not so where the tests themselves run in the background.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    file = tmp_path / RESULTS
    while not (file.exists() and file.stat().st_size) and process.poll() is None:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    said, _ = process.communicate(timeout=120)
    assert process.returncode == 130, said
    assert "interrupted; what is in" in said
    rows = read_rows(file)
    assert rows
    assert not any(row.is_lost for row in rows)


def test_every_arm_case_is_run_by_what_it_declares():
    tasks = tasks_of(arm_cases(), all_methods(), Settings())
    by_case = {case.name: {t.method for t in tasks if t.case == case.name} for case in arm_cases()}
    assert by_case["arm-001-sum"] > by_case["arm-001-closest"]
    assert "polish" not in by_case["arm-001-closest"]
    assert len(by_case) == 80
