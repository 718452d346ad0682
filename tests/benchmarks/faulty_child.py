"""What a group's process runs in the tests: methods that fail in every way there is."""

import ctypes
import os
import signal
import sys
from collections.abc import Callable

from benchmarks.cases import Case
from benchmarks.methods.method import Method, Outcome, Settings, judged
from benchmarks.sweep.child import work
from ocp import solve
from solvers import MultipleShooting


def good(case: Case, settings: Settings) -> Outcome:
    return judged(solve(case.build(), MultipleShooting(4)))


def talks(case: Case, settings: Settings) -> Outcome:
    """Prints what looks like an answer, from Python and past it."""
    print("{}")
    os.write(1, b"ready\n")
    return good(case, settings)


def hangs(case: Case, settings: Settings) -> Outcome:
    signal.pause()
    return good(case, settings)


def spins(case: Case, settings: Settings) -> Outcome:
    """Never comes back to the interpreter, as a solver in compiled code."""
    sum(range(10**15))
    return good(case, settings)


def segfaults(case: Case, settings: Settings) -> Outcome:
    ctypes.string_at(0)
    return good(case, settings)


def leaves(case: Case, settings: Settings) -> Outcome:
    os._exit(3)


def leaves_quietly(case: Case, settings: Settings) -> Outcome:
    os._exit(0)


def is_killed(case: Case, settings: Settings) -> Outcome:
    os.kill(os.getpid(), signal.SIGKILL)
    return good(case, settings)


def runs_out_of_memory(case: Case, settings: Settings) -> Outcome:
    bytearray(1 << 60)
    return good(case, settings)


def raises(case: Case, settings: Settings) -> Outcome:
    raise ValueError("a mistake in the method")


def is_interrupted(case: Case, settings: Settings) -> Outcome:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # where the tests run in the background
    os.kill(os.getpid(), signal.SIGINT)
    return good(case, settings)


RUNS: tuple[Callable[[Case, Settings], Outcome], ...] = (
    good, talks, hangs, spins, segfaults, leaves, leaves_quietly, is_killed, runs_out_of_memory,
    raises, is_interrupted,
)  # fmt: skip

if __name__ == "__main__":
    work([Method(run.__name__, "direct", frozenset(), run, "", "") for run in RUNS])
    sys.exit(0)
