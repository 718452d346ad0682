"""Runs a group of tasks in child processes: what hangs or crashes costs its own row only."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import IO

from benchmarks.sweep.child import READY
from benchmarks.sweep.error import SweepError
from benchmarks.sweep.row import CRASHED, TIMED_OUT, Row
from benchmarks.sweep.task import SweepTask

_LONGEST = 300  # characters of a message


@dataclass(frozen=True)
class Group:
    """What is sent to a worker.

    Attributes:
        tasks: computed one after the other, in one process as long as it lives.
        limit: time for each [s].
        module: what the process runs; tests have one with methods that crash.
    """

    tasks: tuple[SweepTask, ...]
    limit: float
    module: str = "benchmarks.sweep.child"


def run_group(group: Group, tell: Callable[[Row], object] = lambda row: None) -> list[Row]:
    """Return a row for each task, in their order.

    A task whose process ends is lost, with the reason; the tasks after it get a new process.

    Args:
        group: what to compute.
        tell: is called with every row as soon as it is there.

    Raises:
        SweepError: if no process can be started, or it is interrupted from the keyboard.
    """
    rows: list[Row] = []
    while len(rows) < len(group.tasks):
        for row in _one_process(group, group.tasks[len(rows) :]):
            tell(row)
            rows.append(row)
    return rows


def _one_process(group: Group, tasks: Sequence[SweepTask]) -> Iterator[Row]:
    """Yield the rows that one process computes, at last the row that it did not survive."""
    with tempfile.TemporaryFile() as errors:
        process = _start(group.module, errors)
        assert process.stdin is not None
        assert process.stdout is not None
        with process:
            order = {"limit": group.limit, "tasks": [asdict(task) for task in tasks]}
            _send(process.stdin, json.dumps(order))
            begun = process.stdout.readline() == READY
            last, number = time.monotonic(), 0
            for line in process.stdout:
                if line.endswith("\n"):  # else it ended while it wrote
                    yield Row.parse(line)
                    last, number = time.monotonic(), number + 1
        elapsed = time.monotonic() - last
        if process.returncode == -signal.SIGINT:
            raise SweepError("interrupted")
        if not begun:
            raise SweepError(f"no process could be started: {_last_line(errors)}")
        if number < len(tasks):
            status, message = _reason(process.returncode, group.limit, errors)
            yield Row.lost(tasks[number], status, message, elapsed)


def _start(module: str, errors: IO[bytes]) -> subprocess.Popen[str]:
    """Start a process that imports what this one imports, and computes with one thread."""
    path = os.pathsep.join(entry for entry in sys.path if entry)
    # Two processes of two BLAS threads each are slower than two of one.
    single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen(
        [sys.executable, "-m", module],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        text=True,
        encoding="utf-8",
        env={**single, **os.environ, "PYTHONPATH": path},
    )


def _send(pipe: IO[str], order: str) -> None:
    try:
        pipe.write(order)
        pipe.close()
    except BrokenPipeError:  # it ended before it read: the caller sees that by its silence
        return


def _reason(code: int, limit: float, errors: IO[bytes]) -> tuple[str, str]:
    """Return status and sentence of a process that ended too early."""
    if code == -signal.SIGALRM:
        return TIMED_OUT, f"stopped at the time limit of {limit:g} s"
    if code == -signal.SIGKILL:
        return CRASHED, "the process was ended by SIGKILL, as the kernel does when memory is short"
    if code < 0:
        return CRASHED, f"the process was ended by {signal.Signals(-code).name}"
    return CRASHED, f"the process ended with code {code}: {_last_line(errors)}"


def _last_line(errors: IO[bytes]) -> str:
    errors.seek(0)
    lines = errors.read().decode(errors="replace").strip().splitlines()
    return lines[-1].strip()[:_LONGEST] if lines else "it said nothing"
