"""The sweep: rows as they are promised, nothing lost, nothing computed twice."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cases import all_cases, arm_cases
from benchmarks.methods.every import all_methods
from benchmarks.methods.method import Settings
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
# The first two methods that it declares.
DIRECT = [m.name for m in all_methods() if m.family == "direct" and QUICK.suite in m.suites][:2]
SMALL = chosen({QUICK.name}, DIRECT)


def test_a_row_has_what_the_readme_promises(tmp_path):
    rows = sweep(SMALL, tmp_path, resume=False, progress=False)
    assert [(row.case, row.solver) for row in rows] == [(t.case, t.method) for t in SMALL]
    assert all(row.solved and row.optimum for row in rows)
    lines = (tmp_path / RESULTS).read_text().splitlines()
    assert len(lines) == len(SMALL)
    assert all(set(json.loads(line)) >= PROMISED for line in lines)


def test_resume_recomputes_nothing_that_is_there(tmp_path):
    sweep(SMALL[:1], tmp_path, resume=False, progress=False)
    before = (tmp_path / RESULTS).read_text()
    rows = sweep(SMALL, tmp_path, resume=True, progress=False)
    after = (tmp_path / RESULTS).read_text()
    assert after.startswith(before)
    assert len(after.splitlines()) == len(rows) == len(SMALL)


def test_without_resume_rows_are_computed_again_and_the_newest_counts(tmp_path):
    sweep(SMALL[:1], tmp_path, resume=False, progress=False)
    rows = sweep(SMALL[:1], tmp_path, resume=False, progress=False)
    assert len((tmp_path / RESULTS).read_text().splitlines()) == 2
    assert len(rows) == 1


def test_a_damaged_line_costs_that_row_only(tmp_path):
    sweep(SMALL[:1], tmp_path, resume=False, progress=False)
    file = tmp_path / RESULTS
    file.write_text(file.read_text() + '{"suite": "textbook", "ca')
    said = []
    rows = sweep(SMALL, tmp_path, resume=True, progress=False, say=said.append)
    assert len(said) == 1
    assert "line 2" in said[0]
    assert len(rows) == len(read_rows(file)) == 2


def test_what_was_lost_is_computed_again_only_where_asked(tmp_path):
    lost = Row.lost(SMALL[0], CRASHED, "a test", 1.0)
    lost.append_to(tmp_path / RESULTS)
    assert sweep(SMALL[:1], tmp_path, resume=True, progress=False) == (lost,)
    (row,) = sweep(SMALL[:1], tmp_path, resume=True, retry=True, progress=False)
    assert row.solved


def test_tasks_are_grouped_by_what_they_share():
    case = [case for case in all_cases() if case.name == "van-der-pol"]
    methods = [method for method in all_methods() if method.name in DIRECT]
    tasks = tasks_of(case, methods, Settings(1, 0), Settings(1, 1), Settings(2, 0))
    assert len({task.key for task in tasks}) == 6
    assert [len(group) for group in groups_of(tasks)] == [2, 2, 2]


KILLS = 10
SWEPT = [
    sys.executable, "-m", "benchmarks", "run", "--workers", "2",
    "--case", "van-der-pol", "double-integrator-energy", "bryson-denham",
    "--solver", *DIRECT, "--starts", "1", "--seeds", "0", "1",
]  # fmt: skip
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
        assert len((folder / RESULTS).read_text().splitlines()) == len(rows) == 12


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
