"""The sweep: rows as they are promised, nothing lost, nothing computed twice."""

import json
import subprocess
import sys
import time

import pytest

from benchmarks.cases import all_cases, arm_cases
from benchmarks.method import Settings
from benchmarks.methods import all_methods
from benchmarks.row import RESULTS, read_rows
from benchmarks.sweep import sweep, tasks_of

PROMISED = {
    "suite", "case", "solver", "settings", "seed", "status", "solved", "cost", "reference", "gap",
    "violation", "stationarity", "iterations", "build_time", "solve_time", "versions", "machine",
}  # fmt: skip


def chosen(case_names, method_names):
    cases = [case for case in all_cases() if case.name in case_names]
    methods = [method for method in all_methods() if method.name in method_names]
    return tasks_of(cases, methods, Settings(starts=1))


SMALL = chosen({"van-der-pol", "double-integrator-energy"}, {"direct-coarse", "extremal"})


KILLED = ["van-der-pol", "rayleigh", "goddard", "two-link-arm-energy", "polar-arm"]


def test_a_row_has_what_the_readme_promises(tmp_path):
    rows = sweep(SMALL, tmp_path, workers=1, resume=False, progress=False)
    assert [(row.case, row.solver) for row in rows] == [(t.case, t.method) for t in SMALL]
    assert all(row.solved and row.optimum for row in rows)
    lines = (tmp_path / RESULTS).read_text().splitlines()
    assert len(lines) == len(SMALL)
    assert all(set(json.loads(line)) >= PROMISED for line in lines)


def test_resume_recomputes_nothing_that_is_there(tmp_path):
    sweep(SMALL[:2], tmp_path, workers=1, resume=False, progress=False)
    before = (tmp_path / RESULTS).read_text()
    rows = sweep(SMALL, tmp_path, workers=1, resume=True, progress=False)
    after = (tmp_path / RESULTS).read_text()
    assert after.startswith(before)
    assert len(after.splitlines()) == len(rows) == len(SMALL)


def test_without_resume_rows_are_computed_again_and_the_newest_counts(tmp_path):
    sweep(SMALL[:1], tmp_path, workers=1, resume=False, progress=False)
    rows = sweep(SMALL[:1], tmp_path, workers=1, resume=False, progress=False)
    assert len((tmp_path / RESULTS).read_text().splitlines()) == 2
    assert len(rows) == 1


@pytest.mark.parametrize("damage", ['{"suite": "library", "ca', "not json at all\n", "{}\n"])
def test_a_damaged_line_costs_that_row_only(tmp_path, damage):
    sweep(SMALL[:1], tmp_path, workers=1, resume=False, progress=False)
    file = tmp_path / RESULTS
    file.write_text(file.read_text() + damage)
    rows = sweep(SMALL[:2], tmp_path, workers=1, resume=True, progress=False)
    assert len(rows) == 2
    assert len(read_rows(file)) == 2


@pytest.mark.slow
def test_a_killed_run_goes_on_where_it_was(tmp_path):
    command = [sys.executable, "-m", "benchmarks", "run", "--case", *KILLED]
    command += ["--solver", "direct-coarse", "direct-fine", "--workers", "2"]
    command += ["--out", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    file = tmp_path / RESULTS
    deadline = time.monotonic() + 60
    while not (file.exists() and file.stat().st_size) and time.monotonic() < deadline:
        time.sleep(0.02)
    process.kill()
    process.wait()
    before = file.read_bytes()
    finished = subprocess.run([*command, "--resume"], capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stdout
    assert file.read_bytes().startswith(before)
    undisturbed = {(case, solver) for case in KILLED for solver in ("direct-coarse", "direct-fine")}
    assert {(row.case, row.solver) for row in read_rows(file)} == undisturbed


def test_every_arm_case_is_run_by_what_it_declares():
    tasks = tasks_of(arm_cases(), all_methods(), Settings())
    by_case = {case.name: {t.method for t in tasks if t.case == case.name} for case in arm_cases()}
    assert by_case["arm-001-sum"] > by_case["arm-001-closest"]
    assert "polish" not in by_case["arm-001-closest"]
    assert len(by_case) == 80
