"""``SubprocessFunction``: a CasADi Function in a process of its own, with a time limit per call."""

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
# One thread: the server forks, and its work is not parallel.
_SINGLE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
# Start-up timeout of the server [s].
_START = 60.0
# So long after its limit a process that has not ended itself, since it is stopped, is ended [s].
_GRACE = 0.5
# Longest time limit that an alarm of the kernel accepts, with a margin [s].
_LONGEST = 1e6
#: Whether this system has fork and alarms of the kernel.
SUBPROCESS_SUPPORTED = hasattr(os, "fork") and hasattr(signal, "setitimer")

Inputs = dict[str, np.ndarray]
Outputs = dict[str, np.ndarray]


class SubprocessLost(Exception):
    """A call returned nothing; the message says why."""


class SubprocessFunction:
    """A CasADi Function that cannot hang or crash the process that calls it.

    An iteration limit, or a clock in this process, cannot end compiled third-party code that
    loops inside one iteration. ``python -m benchmarks arm-speed --only-driver`` shows how much
    longer a call takes than in this process. Its process is started at once, which takes some
    tenths of a second, and ends with it. A call after a lost one is not slower, unless its process
    was stopped or interrupted.

    Args:
        function: a Function that can be pickled.
        seconds: time limit of a call.
        verbose: whether its output is shown.

    Attributes:
        process: id of the process, and of its process group.
    """

    def __init__(self, function: ca.Function, seconds: float, *, verbose: bool = False) -> None:
        """Start the process."""
        self.function, self.seconds, self.verbose = function, min(seconds, _LONGEST), verbose
        self._lock = Lock()
        self._start()

    def __reduce__(self) -> tuple[Callable[..., Self], tuple[ca.Function, float]]:
        """Pickle and copy the Function and its limit; the copy starts a process of its own."""
        return partial(type(self), verbose=self.verbose), (self.function, self.seconds)

    def __call__(self, inputs: Inputs) -> tuple[Outputs, dict[str, Any]]:
        """Return outputs and statistics.

        Raises:
            RuntimeError: where the Function does.
            SubprocessLost: if the call took too long, or its process ended by itself.
            KeyboardInterrupt: after Ctrl-C; the process is ended.
        """
        if self._owner != os.getpid():  # after a fork: process and lock are the parent's
            self._lock = Lock()
            self._start()
        with self._lock:
            reply = self._request(inputs)
        if isinstance(reply, RuntimeError):
            raise reply
        if reply == signal.SIGALRM.name:
            raise SubprocessLost(f"did not return within {self.seconds:g} s")
        if isinstance(reply, str):
            raise SubprocessLost(f"was ended by {reply}")
        return reply

    def _request(self, inputs: Inputs) -> Any:
        """Return the outputs and statistics, an exception, or the signal that ended the process."""
        if not self._finish.alive:  # the last call was interrupted, or the process lost in it
            self._start()
        self._requests += 1
        number, reply, answered = 0, None, False
        try:
            self._pipe.send((self._requests, inputs))
            # Replies are numbered: if the process died between two calls, this call takes the
            # notice of that for its own loss, and its reply must not be taken by the next one.
            while number not in (self._requests, None):
                number, reply = self._reply(self.seconds + _GRACE)
            answered = True
        except (EOFError, ConnectionError):
            raise SubprocessLost("ended with its process") from None
        finally:
            if not answered:  # after Ctrl-C too
                self._finish()
        return reply

    def _reply(self, seconds: float) -> tuple[int | None, Any]:
        """Return the next reply with its number, or raise ``SubprocessLost`` after a while."""
        if self._pipe.poll(seconds):
            return self._pipe.recv()
        raise SubprocessLost(f"did not return within {self.seconds:g} s")

    def _start(self) -> None:
        """Start a process."""
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
                # Ctrl-C does not reach it, and all its processes can be ended at once.
                start_new_session=True,
            )
        self.process, self._owner = process.pid, os.getpid()
        self._requests = 0
        self._finish = finalize(self, _end, process, self._pipe, self._owner)
        # If it dies at once the first call reports that.
        with suppress(EOFError, ConnectionError, SubprocessLost):
            self._pipe.send((self.function, self.seconds))
            self._reply(_START)


def _end(process: subprocess.Popen[bytes], pipe: Connection, owner: int) -> None:
    """End a process and all it has started, if this process started it."""
    pipe.close()
    if owner == os.getpid() and process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
