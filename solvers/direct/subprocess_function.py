"""Calls a CasADi Function in a process of its own, which is ended when it does not return."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from threading import Lock
from typing import Any, Self
from weakref import finalize

import casadi as ca
import numpy as np

_SERVER = Path(__file__).with_name("subprocess_server.py")
# One thread: the server forks, and none of its work is shared among several.
_SINGLE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
# A server that takes longer to start is none [s].
_START = 60.0
# No alarm can be set for much later [s].
_LONGEST = 1e6
#: Whether this system has what it takes: fork, and alarms of the kernel.
SUBPROCESS_SUPPORTED = hasattr(os, "fork") and hasattr(signal, "setitimer")

Inputs = dict[str, np.ndarray]
Outputs = dict[str, np.ndarray]


class SubprocessLost(Exception):
    """A call ended without an answer; the message says how."""


class SubprocessFunction:
    """A CasADi Function that cannot hang or crash the process that calls it.

    A limit of iterations, or a clock in this process, is no use where compiled code of somebody
    else loops inside one iteration. A call takes longer than in this process, by what
    ``python -m benchmarks arm-speed --only-driver`` shows, the first one by some tenths of a
    second; after a loss the next is as quick as ever.

    Args:
        function: must be one that can be pickled.
        seconds: what a call may take.
        verbose: whether what it prints is shown.

    Attributes:
        process: the number of the process, and of the group of those that it starts.
    """

    def __init__(self, function: ca.Function, seconds: float, *, verbose: bool = False) -> None:
        """Start the process."""
        self.function, self.seconds, self.verbose = function, min(seconds, _LONGEST), verbose
        self._finish: Callable[[], object] | None = None
        self._lock = Lock()
        self._start()

    def __reduce__(self) -> tuple[Callable[..., Self], tuple[ca.Function, float]]:
        """Pickle and copy what is called, not who answers."""
        return partial(type(self), verbose=self.verbose), (self.function, self.seconds)

    def __call__(self, inputs: Inputs) -> tuple[Outputs, dict[str, Any]]:
        """Return outputs and statistics.

        Raises:
            RuntimeError: where the Function does.
            Lost: if the call took too long, or its process ended by itself.
        """
        if self._owner != os.getpid():  # a fork: process, and who waits for it, are the other one's
            self._lock = Lock()
            self._start()
        with self._lock:
            answer = self._asked_for(inputs)
        if isinstance(answer, RuntimeError):
            raise answer
        if answer == signal.SIGALRM.name:
            raise SubprocessLost(f"did not return within {self.seconds:g} s")
        if isinstance(answer, str):
            raise SubprocessLost(f"was ended by {answer}")
        return answer

    def _asked_for(self, inputs: Inputs) -> Any:
        if self._answered < self._asked:  # interrupted, or nobody is there
            self._start()
        self._asked += 1
        number, answer = 0, None
        try:
            self._pipe.send((self._asked, inputs))
            # A process that died between two calls leaves a word that this call takes for its
            # own loss, and the answer to this one to the next call, which must not take it.
            while number not in (self._asked, None):
                if not self._pipe.poll(self.seconds + _START):
                    raise SubprocessLost(
                        f"did not return within {self.seconds:g} s, nor did its process"
                    )
                number, answer = self._pipe.recv()
        except (EOFError, ConnectionError):
            raise SubprocessLost("ended with its process") from None
        self._answered = self._asked
        return answer

    def _start(self) -> None:
        """Start a process, in place of the last one if there is one."""
        if self._finish:
            self._finish()
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
                env={**os.environ, **_SINGLE, "PYTHONPATH": path},
                # Ctrl-C is for this process; and all of that session can be ended at once.
                start_new_session=True,
            )
        self.process, self._owner = process.pid, os.getpid()
        self._asked = self._answered = 0
        self._finish = finalize(self, _end, process, self._pipe, self._owner)
        with suppress(ConnectionError):  # it died at once: the first call will find out
            self._pipe.send((self.function, self.seconds))


def _end(process: subprocess.Popen[bytes], pipe: Connection, owner: int) -> None:
    """End a process and what it started, if it is ours."""
    pipe.close()
    if owner == os.getpid() and process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
