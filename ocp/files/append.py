"""Writes that are counted: all of it is in the file, or nothing."""

import os
from contextlib import suppress
from errno import EIO
from pathlib import Path
from stat import S_ISREG


def write_all(descriptor: int, content: bytes) -> None:
    """Write everything; the kernel may take a part at a time.

    Raises:
        OSError: if it cannot be written as a whole.
    """
    rest = memoryview(content)
    while rest:
        rest = _after_a_write(descriptor, rest)


def append(descriptor: int, content: bytes) -> None:
    """Write at the end of a file that is open for appending, by this process alone.

    Raises:
        OSError: if it cannot be written as a whole; the file ends where it did.
    """
    rest = memoryview(content)
    try:
        while rest:
            rest = _after_a_write(descriptor, rest)
    finally:
        if rest:
            with suppress(OSError):  # a pipe
                end = os.fstat(descriptor).st_size - (len(content) - len(rest))
                os.ftruncate(descriptor, end)


def _after_a_write(descriptor: int, rest: memoryview) -> memoryview:
    """Write what the kernel takes at once; return what is left."""
    written = os.write(descriptor, rest)
    if not written:
        raise OSError(EIO, os.strerror(EIO))
    return rest[written:]


def append_line(path: Path, line: bytes) -> None:
    """Write a line at the end of a file and bring it to the disk; a torn last line is ended first.

    Args:
        path: the file, made if it is not there.
        line: with its end.

    Raises:
        OSError: if it cannot be written as a whole; the file ends where it did.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o666)
    try:
        size = os.fstat(descriptor).st_size
        is_torn = size > 0 and os.pread(descriptor, 1, size - 1) != b"\n"
        append(descriptor, b"\n" * is_torn + line)
        sync(descriptor)
    finally:
        os.close(descriptor)


def sync(descriptor: int) -> None:
    """Bring a file to the disk; a pipe or a device has none.

    Raises:
        OSError: if that fails.
    """
    if S_ISREG(os.fstat(descriptor).st_mode):
        os.fsync(descriptor)
