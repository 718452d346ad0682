"""Calls a CasADi Function in a process of its own, which is ended when it does not return."""

import os
import signal
import subprocess
import sys
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from threading import Lock
from typing import Any
from weakref import finalize

import casadi as ca
import numpy as np

_SERVER = Path(__file__).with_name("apart_server.py")
_SINGLE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
#: Whether this system has what it takes: fork, and alarms of the kernel.
POSSIBLE = hasattr(os, "fork") and hasattr(signal, "setitimer")

Inputs = dict[str, np.ndarray]
Outputs = dict[str, np.ndarray]


class Lost(Exception):
    """A call ended without an answer; the message says how."""


class Apart:
    """A CasADi Function that cannot hang or crash the process that calls it.

    A limit of iterations, or a clock in this process, is no use where compiled code of somebody
    else loops inside one iteration. A call costs about 0.2 ms more than in this process, the first
    one some tenths of a second; after a loss the next one is as quick as ever.

    Args:
        function: must be one that can be pickled.
        seconds: what a call may take.
        verbose: whether what it prints is shown.

    Attributes:
        process: the number of the process, and of the group of those that it starts.
    """

    def __init__(self, function: ca.Function, seconds: float, *, verbose: bool = False) -> None:
        """Start the process."""
        self.function, self.seconds, self.verbose = function, seconds, verbose
        self._lock = Lock()
        self._start()

    def __call__(self, inputs: Inputs) -> tuple[Outputs, dict[str, Any]]:
        """Return outputs and statistics.

        Raises:
            RuntimeError: where the Function does.
            Lost: if the call took too long, or its process ended by itself.
        """
        with self._lock:
            # A fork's process is still the other one's; an answer that nobody took, since the
            # process died or the call was interrupted, would be taken for that of this call.
            if self._owner != os.getpid() or self._is_asked:
                self._start()
            self._is_asked = True
            try:
                self._pipe.send(inputs)
                answer = self._pipe.recv()
            except (EOFError, ConnectionError):
                raise Lost("ended with its process") from None
            self._is_asked = False
        if answer is None:
            raise RuntimeError("the Function threw an exception")
        if answer == signal.SIGALRM.name:
            raise Lost(f"did not return within {self.seconds:g} s")
        if isinstance(answer, str):
            raise Lost(f"was ended by {answer}")
        return answer

    def _start(self) -> None:
        """Start a process, in place of the last one if there is one."""
        if last := getattr(self, "_end", None):
            last()
        path = os.pathsep.join(entry for entry in sys.path if entry)
        printed = None if self.verbose else subprocess.DEVNULL
        self._pipe, theirs = Pipe()
        with theirs:
            process = subprocess.Popen(
                [sys.executable, "-P", str(_SERVER), str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=printed,
                stderr=printed,
                # One thread: it forks, and none of its work is shared among several.
                env={**os.environ, **_SINGLE, "PYTHONPATH": path},
                # Ctrl-C is for this process; and all of that session can be ended at once.
                start_new_session=True,
            )
        self.process, self._owner, self._is_asked = process.pid, os.getpid(), False
        self._end = finalize(self, _end, process, self._pipe, self._owner)
        self._pipe.send((self.function, self.seconds))


def _end(process: subprocess.Popen[bytes], pipe: Connection, owner: int) -> None:
    """End a process and what it started, if it is ours."""
    pipe.close()
    if owner == os.getpid() and process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
