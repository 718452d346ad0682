"""Results as one ``.npz`` file each."""

import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Literal
from zipfile import BadZipFile

import numpy as np

from ocp.checks.arguments import check_instance
from ocp.checks.errors import ProblemError


def write_archive(path: str | Path, what: str, content: Mapping[str, Any]) -> Path:
    """Write arrays by name; return the path, with the suffix ``.npz``.

    Raises:
        ProblemError: if it cannot be written; ``what`` is what it should have been.
    """
    check_instance(path, (str, Path), f"the path of a saved {what}")
    path = Path(path)
    path = path if path.suffix == ".npz" else path.with_name(f"{path.name}.npz")
    with opened(path, "wb", f"saved {what}") as file:
        np.savez_compressed(file, **content)
    return path


def read_archive(path: str | Path, what: str, needed: Collection[str]) -> dict[str, np.ndarray]:
    """Return the arrays of a file by name.

    Raises:
        ProblemError: if it cannot be read or lacks a name; ``what`` is what it should have been.
    """
    with opened(path, "rb", f"saved {what}") as raw:
        try:
            with np.load(raw) as file:
                data = {name: file[name] for name in file.files}
        except (OSError, ValueError, TypeError, EOFError, BadZipFile, zlib.error) as error:
            raise ProblemError(f"{path} is no saved {what}: {error}") from error
    missing = set(needed) - set(data)
    if missing:
        raise ProblemError(f"{path} is no saved {what}: {', '.join(sorted(missing))} missing")
    return data


def opened(path: str | Path, mode: Literal["rb", "wb"], what: str) -> BinaryIO:
    """Return an open file.

    Raises:
        ProblemError: if there is none of that path, or it may not be opened.
    """
    check_instance(path, (str, Path), f"the path of a {what}")
    try:
        return Path(path).open(mode)
    except OSError as error:
        done = "read" if mode == "rb" else "written"
        raise ProblemError(f"the {what} {path} cannot be {done}: {error.strerror}") from error
