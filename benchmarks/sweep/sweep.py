"""Runs cases by methods in parallel, one line of results at a time, resumable."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from benchmarks.sweep.executors import Execution
from benchmarks.sweep.guard import Group, run_group
from benchmarks.sweep.row import RESULTS, Row, versions
from benchmarks.sweep.rows_file import prepare, read_rows
from benchmarks.sweep.task import Task, groups_of


def sweep(
    tasks: Sequence[Task],
    out: Path,
    *,
    resume: bool,
    execution: Execution | None = None,
    retry: bool = False,
    progress: bool = True,
    say: Callable[[str], object] = lambda note: None,
) -> tuple[Row, ...]:
    """Run tasks and return their rows; a group's are appended to a file when it is ready.

    Nobody but this process writes the file. It can be killed at any moment: what it has written is
    whole, what it has not is computed again.

    Args:
        tasks: what to run.
        out: folder of ``results.jsonl``, made if it is not there.
        resume: leave out what the folder has already.
        execution: where, and with what time limit; None: one process of this machine at a time.
        retry: with ``resume``, compute again what was lost to a time limit or a crash.
        progress: show a bar.
        say: is called with a sentence about everything in the folder that cannot be used.

    Raises:
        SweepError: if there are no workers, or they went away; the rows so far are kept.
    """
    out.mkdir(parents=True, exist_ok=True)
    file = out / RESULTS
    for note in prepare(file):
        say(note)
    execution = execution or Execution()
    wanted = {task.key: task for task in tasks}
    done = {row.key for row in read_rows(file) if not (retry and row.is_lost)} if resume else set()
    todo = [task for key, task in wanted.items() if key not in done]
    groups = [Group(group, execution.limit) for group in groups_of(todo)]
    with _bar(progress) as bar:
        line = bar.add_task("benchmarks", total=len(wanted), completed=len(wanted) - len(todo))
        if groups:
            with execution.open() as executor:
                _collect(executor, groups, file, lambda rows: bar.advance(line, rows), say)
    rows = {row.key: row for row in read_rows(file)}
    return tuple(rows[key] for key in wanted if key in rows)


def _collect(
    executor: Executor,
    groups: Sequence[Group],
    file: Path,
    advance: Callable[[int], None],
    say: Callable[[str], object],
) -> None:
    """Send all groups and write what comes back."""
    others = set()
    for future in as_completed([executor.submit(run_group, group) for group in groups]):
        rows = future.result()
        for row in rows:
            row.append_to(file)
        advance(len(rows))
        others |= {str(row.versions) for row in rows if row.versions != versions()}
    for other in sorted(others):
        say(f"workers with other versions have computed rows: {other}; here {versions()}")


def _bar(visible: bool) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    return Progress(*columns, TimeRemainingColumn(), disable=not visible)
