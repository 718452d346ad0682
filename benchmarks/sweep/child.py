"""``python -m benchmarks.sweep.child``: computes tasks in a process that may hang or die.

In: one JSON object, the tasks and how long each may take. Out: a line ``ready``, then a row a line.
"""

import json
import os
import signal
import sys
from collections.abc import Sequence
from typing import TextIO

from benchmarks.cases import all_cases
from benchmarks.methods.every import all_methods
from benchmarks.methods.method import Method, Settings
from benchmarks.sweep.row import Row
from benchmarks.sweep.task import SweepTask

READY = "ready\n"


def work(methods: Sequence[Method]) -> None:
    """Compute the tasks of the standard input.

    The kernel keeps the time: an alarm ends the process wherever it is, in compiled code too, and
    also where nobody waits for it any more.
    """
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # as of a job in the background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    answers = _own_output()
    order = json.load(sys.stdin)
    cases = {(case.suite, case.name): case for case in all_cases()}
    by_name = {method.name: method for method in methods}
    _answer(answers, READY)
    for entry in order["tasks"]:
        task = SweepTask(**{**entry, "settings": Settings(**entry["settings"])})
        signal.setitimer(signal.ITIMER_REAL, order["limit"])
        case, method = cases[task.suite, task.case], by_name[task.method]
        outcome = method.run(case, task.settings)
        _answer(answers, Row.of(case, method, task.settings, outcome).line())


def _own_output() -> TextIO:
    """Keep the standard output for rows: what a solver prints goes where errors go."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return answers


def _answer(answers: TextIO, line: str) -> None:
    answers.write(line)
    answers.flush()


if __name__ == "__main__":
    work(all_methods())
