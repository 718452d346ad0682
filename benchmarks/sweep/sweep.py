"""Runs cases by methods in parallel, one line of results at a time, resumable."""

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from benchmarks.sweep.error import SweepError
from benchmarks.sweep.executors import Execution
from benchmarks.sweep.guard import Group
from benchmarks.sweep.lock import locked
from benchmarks.sweep.row import RESULTS, Row, versions
from benchmarks.sweep.rows_file import prepare, read_rows
from benchmarks.sweep.task import Key, SweepTask, groups_of


def sweep(
    tasks: Sequence[SweepTask],
    out: Path,
    *,
    resume: bool,
    execution: Execution | None = None,
    retry: bool = False,
    progress: bool = True,
    say: Callable[[str], object] = lambda note: None,
) -> tuple[Row, ...]:
    """Run tasks and return their rows; each is appended to a file as soon as it is there.

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
        SweepError: if there are no workers, or they went away, or a row cannot be written, the
            rows so far are kept; or if another sweep writes to the folder.
    """
    out.mkdir(parents=True, exist_ok=True)
    file, wanted = out / RESULTS, {task.key: task for task in tasks}
    with locked(out):
        for note in prepare(file):
            say(note)
        done = _done(file, retry) if resume else set()
        todo = [task for key, task in wanted.items() if key not in done]
        with _bar(progress) as bar:
            line = bar.add_task("benchmarks", total=len(wanted), completed=len(wanted) - len(todo))
            _compute(todo, execution or Execution(), file, lambda: bar.advance(line), say)
        rows = {row.key: row for row in read_rows(file)}
    return tuple(rows[key] for key in wanted if key in rows)


def _done(file: Path, retry: bool) -> set[Key]:
    return {row.key for row in read_rows(file) if not (retry and row.is_lost)}


def _compute(
    todo: Sequence[SweepTask],
    execution: Execution,
    file: Path,
    advance: Callable[[], object],
    say: Callable[[str], object],
) -> None:
    """Compute the tasks and write every row as it comes."""
    groups = [Group(group, execution.limit) for group in groups_of(todo)]
    if not groups:
        return
    others = set()
    with closing(execution.rows(groups)) as rows:
        for row in rows:
            _write(row, file)
            advance()
            others |= {str(row.versions)} if row.versions != versions() else set()
    for other in sorted(others):
        say(f"workers with other versions have computed rows: {other}; here {versions()}")


def _write(row: Row, file: Path) -> None:
    try:
        row.append_to(file)
    except OSError as reason:
        raise SweepError(f"{file} cannot be written: {reason.strerror}") from reason


def _bar(visible: bool) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    return Progress(*columns, TimeRemainingColumn(), disable=not visible)
