"""A file is written beside its place, and takes it when it is whole and on the disk."""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import EACCES
from pathlib import Path

from ocp.files.append import write_all

try:
    import fcntl
except ImportError:  # on Windows drafts of killed processes stay
    fcntl = None

_DRAFT = ".ocp-{}.draft"


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield the path of a draft, which replaces the file if the ``with`` ends without an error.

    Until then, and whatever happens, the file is as it was. The draft has the file's name, in a
    folder of its own beside it. A device or a pipe, which cannot be replaced, is yielded itself.

    Raises:
        OSError: if the draft cannot be made, brought to the disk or put in its place.
    """
    path = Path(os.path.realpath(path))  # the file behind a link, not the link
    if path.exists() and not path.is_file():
        yield path
        return
    if path.exists() and not os.access(path, os.W_OK):
        raise PermissionError(EACCES, os.strerror(EACCES), str(path))
    with draft_folder(path.parent) as folder:
        draft = folder / path.name
        yield draft
        if path.exists():
            shutil.copymode(path, draft)
        sync_file(draft)
        draft.replace(path)
        sync_folder(path.parent)


def write_file(path: str | Path, content: bytes) -> None:
    """Write a file as a whole, or leave the old one.

    Raises:
        OSError: if it cannot be written.
    """
    with replacing(path) as draft, draft.open("wb", buffering=0) as file:
        write_all(file.fileno(), content)


@contextmanager
def draft_folder(parent: Path) -> Iterator[Path]:
    """Make a folder for what is not done yet; it is removed at the end.

    It is held by a lock of the kernel, which ends with the process: the next draft in ``parent``
    removes those that nobody holds any more.

    Raises:
        OSError: if it cannot be made.
    """
    remove_abandoned(parent)
    folder, lock = _begun(parent)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def remove_abandoned(parent: Path) -> None:
    """Remove the drafts of processes that were killed."""
    if fcntl is None:
        return
    for folder in parent.glob(_DRAFT.format("*")):
        with suppress(OSError):
            lock = os.open(folder, os.O_RDONLY | os.O_NOFOLLOW)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(lock)


def sync_file(file: Path) -> None:
    """Bring the content of a file to the disk.

    Raises:
        OSError: if that fails.
    """
    descriptor = os.open(file, os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk, where the system can."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _begun(parent: Path) -> tuple[Path, int | None]:
    """Return a new folder and the descriptor that holds its lock."""
    while True:
        folder = parent / _DRAFT.format(secrets.token_hex(8))
        folder.mkdir(0o700)
        if fcntl is None:
            return folder, None
        # Before it is locked, another process may take it for abandoned: then once more.
        with suppress(FileNotFoundError):
            lock = os.open(folder, os.O_RDONLY)
            with suppress(OSError):  # a file system without locks
                fcntl.flock(lock, fcntl.LOCK_EX)
            if folder.exists():
                return folder, lock
            os.close(lock)
