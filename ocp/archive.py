"""Results as one ``.npz`` file each."""

import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from ocp.errors import ProblemError
from ocp.expressions import instance


def write_archive(path: str | Path, content: Mapping[str, Any]) -> Path:
    """Write arrays by name; return the path, with the suffix ``.npz``."""
    path = Path(path)
    path = path if path.suffix == ".npz" else path.with_name(f"{path.name}.npz")
    np.savez_compressed(path, **content)
    return path


def read_archive(path: str | Path, what: str, needed: Collection[str]) -> dict[str, np.ndarray]:
    """Return the arrays of a file by name.

    Raises:
        ProblemError: if it cannot be read or lacks a name; ``what`` is what it should have been.
    """
    instance(path, (str, Path), f"the path of a saved {what}")
    try:
        with Path(path).open("rb") as raw, np.load(raw) as file:
            data = {name: file[name] for name in file.files}
    except OSError as error:
        raise ProblemError(f"the saved {what} {path} cannot be read: {error.strerror}") from error
    except (ValueError, TypeError, EOFError, BadZipFile, zlib.error) as error:
        raise ProblemError(f"{path} is no saved {what}: {error}") from error
    missing = set(needed) - set(data)
    if missing:
        raise ProblemError(f"{path} is no saved {what}: {', '.join(sorted(missing))} missing")
    return data
