"""A program that may hang, crash, or print anything."""

import os
import signal
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile

_MOST = 100_000  # bytes that are read of what it prints


def run_limited(
    words: Sequence[str], limit: float, scratch: Path | None = None
) -> tuple[int | None, str]:
    """Run a program; return its exit code, negative for a signal, and what it has printed.

    At the limit, and where this process is interrupted, it is ended with all that it has started,
    and its code is None.

    Args:
        words: the program and its arguments.
        limit: [s].
        scratch: folder for its own temporary files.

    Raises:
        OSError: if it cannot be started.
        ValueError: if a word has a zero byte.
    """
    own = {} if scratch is None else {"TMPDIR": str(scratch)}
    # A file: a pipe would be waited for until the last of its children closes it.
    with TemporaryFile(dir=scratch) as printed:
        process = subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=subprocess.STDOUT,
            env={**os.environ, **own},
            start_new_session=True,
        )
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            _end(process)
        printed.seek(0)
        return code, printed.read(_MOST).decode(errors="replace")


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a program that still runs, and its session."""
    if process.poll() is not None:
        return
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()
