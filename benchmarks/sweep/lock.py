"""Who may write a results folder: one sweep at a time."""

import fcntl
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.sweep.error import SweepError

LOCK = "results.lock"
_LONGEST = 200  # characters that are read of who holds it


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep a folder for the ``with``; the kernel lets go of it however this process ends.

    The file stays where it is: to remove it would let two sweeps hold two files of one name. What
    is written in it only serves the message.

    Raises:
        SweepError: if another process has it.
    """
    descriptor = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as held:
            holder = os.pread(descriptor, _LONGEST, 0).decode(errors="replace").strip()
            raise SweepError(
                f"another sweep writes to {folder}: {holder or 'it has just begun'}; wait for it, "
                "or take another folder"
            ) from held
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"process {os.getpid()} on {socket.gethostname()}\n".encode(), 0)
        yield
    finally:
        os.close(descriptor)
