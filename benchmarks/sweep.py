"""Runs cases by methods in parallel, one line of results at a time, resumable."""

import os
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from multiprocessing import get_context
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from benchmarks.cases import Case, all_cases
from benchmarks.method import Method, Settings
from benchmarks.methods import all_methods
from benchmarks.row import RESULTS, Key, Row, mend, read_rows

_POLL = 0.2  # [s]


@dataclass(frozen=True)
class Task:
    """One row to compute, by names: what a worker process can be sent."""

    case: str
    method: str
    settings: Settings


def tasks_of(
    cases: Iterable[Case], methods: Sequence[Method], settings: Settings
) -> tuple[Task, ...]:
    """Return a task for every method that a case declares, case by case."""
    return tuple(
        Task(case.name, method.name, settings)
        for case in cases
        for method in methods
        if case.suite in method.suites and method.family in case.families
    )


def sweep(
    tasks: Sequence[Task], out: Path, *, workers: int, resume: bool, progress: bool = True
) -> tuple[Row, ...]:
    """Run tasks and return their rows; each is appended to a file as soon as it is ready.

    Methods of one case run in one process, since several begin where another ended.

    Args:
        tasks: what to run.
        out: folder of ``results.jsonl``, made if it is not there.
        workers: processes; 1: in this process.
        resume: leave out what the folder has already.
        progress: show a bar.
    """
    out.mkdir(parents=True, exist_ok=True)
    file = out / RESULTS
    mend(file)
    cases, methods = _by_name()
    wanted = {_key(task, cases, methods): task for task in tasks}
    done = {row.key for row in read_rows(file)} if resume else set()
    todo = [task for key, task in wanted.items() if key not in done]
    groups = [list(group) for _, group in groupby(todo, key=lambda task: task.case)]
    with _bar(progress) as bar:
        line = bar.add_task("benchmarks", total=len(wanted), completed=len(wanted) - len(todo))
        if workers == 1:
            for group in groups:
                for task in group:
                    _run([task], file)
                    bar.advance(line)
        else:
            _run_in_pool(groups, file, workers, lambda lines: bar.advance(line, lines))
    rows = {row.key: row for row in read_rows(file)}
    return tuple(rows[key] for key in wanted if key in rows)


def _run_in_pool(groups: list[list[Task]], file: Path, workers: int, advance) -> None:
    # Two processes of two BLAS threads each are slower than two of one.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    lines = _lines(file)
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        pending = {pool.submit(_run, group, file) for group in groups}
        while pending:
            time.sleep(_POLL)
            finished: set[Future] = {future for future in pending if future.done()}
            for future in finished:
                future.result()
            pending -= finished
            now = _lines(file)
            advance(now - lines)
            lines = now


def _run(group: list[Task], file: Path) -> None:
    cases, methods = _by_name()
    for task in group:
        case, method = cases[task.case], methods[task.method]
        outcome = method.run(case, task.settings)
        Row.of(case, method, task.settings, outcome).append_to(file)


def _by_name() -> tuple[dict[str, Case], dict[str, Method]]:
    return {c.name: c for c in all_cases()}, {m.name: m for m in all_methods()}


def _key(task: Task, cases: dict[str, Case], methods: dict[str, Method]) -> Key:
    settings = f"{methods[task.method].settings} {task.settings.starts} {task.settings.seed}"
    return cases[task.case].suite, task.case, task.method, settings


def _lines(file: Path) -> int:
    return file.read_bytes().count(b"\n") if file.exists() else 0


def _bar(visible: bool) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    return Progress(*columns, TimeRemainingColumn(), disable=not visible)
