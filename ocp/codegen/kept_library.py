"""Libraries in a cache: what is loaded into this process is what this user has built."""

import os
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from stat import S_ISREG, S_ISVTX, S_IWGRP, S_IWOTH

from ocp.files.draft import sync_file, sync_folder

_DIGEST = 32


def kept_library(folder: Path, key: str, suffix: str) -> Path | None:
    """Return the library of a key; None: it is to be built.

    Its name ends with the hash of its content. What is there under that key and is damaged, or
    another's, or could have been written by others, is removed as far as this user may.

    Raises:
        PermissionError: if everybody may put files into the folder in place of others.
    """
    mode = folder.stat().st_mode
    if mode & S_IWOTH and not mode & S_ISVTX:
        raise PermissionError(f"everybody may change the files in {folder}")
    for library in sorted(folder.glob(f"{key}*{suffix}")):
        with suppress(OSError):  # another process may remove it at the same time
            if _is_own(library) and library.name == _name(key, library, suffix):
                return library
            library.unlink()
    return None


def keep_library(built: Path, stem: Path) -> Path:
    """Give a library that has been built its name, in one step; return it.

    Args:
        built: the file, in a folder on the same file system.
        stem: the name without hash and suffix.

    Raises:
        OSError: if that fails.
    """
    built.chmod(0o700)
    sync_file(built)
    library = stem.with_name(_name(stem.name, built, built.suffix))
    built.replace(library)
    sync_folder(library.parent)
    return library


def _name(key: str, library: Path, suffix: str) -> str:
    return f"{key}-{sha256(library.read_bytes()).hexdigest()[:_DIGEST]}{suffix}"


def _is_own(library: Path) -> bool:
    """Whether a file, not a link, belongs to this user and nobody else may write it."""
    about = library.lstat()
    is_mine = not hasattr(os, "getuid") or about.st_uid == os.getuid()
    is_guarded = os.name != "posix" or not about.st_mode & (S_IWGRP | S_IWOTH)
    return S_ISREG(about.st_mode) and is_mine and is_guarded
