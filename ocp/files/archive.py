"""Arrays by name as one ``.npz`` file, with the checksum of the whole file at its end."""

import os
import re
import zlib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from struct import Struct, error
from tokenize import TokenError
from typing import Any, Literal
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.lib.format import MAGIC_PREFIX

from ocp.checks.arguments import check_instance
from ocp.checks.errors import DamagedFile, ProblemError
from ocp.files.draft import write_file

# The comment of the zip archive, which ends the file: this, and the digest of all before it.
_MARK = b"ocp-toolkit sha256 "
_DIGEST = 64
_SEAL = re.compile(re.escape(_MARK) + rb"([0-9a-f]{64})\Z")
# How a zip archive without a comment ends, as older versions wrote them.
_NO_COMMENT = re.compile(rb"PK\x05\x06.{16}\x00\x00\Z", re.DOTALL)
# Of an entry: signature, five fields, checksum, two sizes, lengths of its name and of what follows.
_ENTRY = Struct("<4s5H3I2H")
# The same in the table at the end, with what else it knows, last the place of the entry.
_LISTED = Struct("<4s6H3I3H8xI")
# What NumPy and zipfile raise of content that is none.
_NO_CONTENT = (
    OSError, ValueError, TypeError, LookupError, ArithmeticError, EOFError, MemoryError,
    RuntimeError, SyntaxError, AttributeError, BadZipFile, TokenError, zlib.error, error,
)  # fmt: skip


def write_archive(path: str | Path, what: str, content: Mapping[str, Any]) -> Path:
    """Write arrays by name; return the path, with the suffix ``.npz``.

    Raises:
        ProblemError: if it cannot be written; ``what`` is what it should have been. A file that
            was there is as it was.
    """
    check_instance(path, (str, Path), f"the path of a saved {what}")
    path = Path(path)
    path = path if path.suffix == ".npz" else path.with_name(f"{path.name}.npz")
    sealed = _sealed(content)
    with named(path, f"saved {what}", "written"):
        write_file(path, sealed)
    return path


def read_archive(path: str | Path, what: str, needed: Collection[str]) -> dict[str, np.ndarray]:
    """Return the arrays of a file by name.

    Raises:
        ProblemError: if it cannot be read; ``what`` is what it should have been.
        DamagedFile: if it is no such file, or not as it was written, or lacks a name.
    """
    check_instance(path, (str, Path), f"the path of a saved {what}")
    with named(path, f"saved {what}", "read"):
        content = Path(path).read_bytes()
    try:
        _check_seal(content)
        with np.load(BytesIO(content)) as file:
            data = {name: file[name] for name in file.files}
    except _NO_CONTENT as reason:
        raise DamagedFile(f"{path} is no saved {what}: {reason}{_advice(content)}") from reason
    missing = set(needed) - set(data)
    if missing:
        raise DamagedFile(f"{path} is no saved {what}: {', '.join(sorted(missing))} missing")
    return data


def whole_arrays(path: str | Path) -> dict[str, np.ndarray]:
    """Return the arrays of a damaged ``.npz`` file that are whole, by name.

    Each by the checksum of its own, and by its name, which must be in the table at the end too
    where that is there. For people who look at what is left: no ``Solution`` is made of it.

    Raises:
        ProblemError: if the file cannot be read.
        DamagedFile: if something in it is whole, and no array.
    """
    check_instance(path, (str, Path), "the path of a damaged file")
    with named(path, "damaged file", "read"):
        found = dict(_whole(Path(path).read_bytes()))
    with made_of(path, "array"):
        return {name: np.load(BytesIO(array)) for name, array in found.items()}


@contextmanager
def made_of(path: str | Path, what: str) -> Iterator[None]:
    """Say which file it is whose arrays are none of what they should be.

    Raises:
        DamagedFile: for every error of a kind, shape or number inside.
    """
    try:
        yield
    except (TypeError, ValueError, LookupError, ArithmeticError) as reason:
        raise DamagedFile(f"{path} is no saved {what}: {reason}") from reason


@contextmanager
def named(path: str | Path, what: str, done: Literal["read", "written"]) -> Iterator[None]:
    """Say which file it is that cannot be read or written.

    Raises:
        ProblemError: for every OSError inside, or a path that no file can have.
    """
    try:
        os.lstat(path)
    except ValueError as reason:  # a zero byte, half a character
        said = f"no file has the name {str(path)!r}"
        raise ProblemError(f"the {what} cannot be {done}: {said}") from reason
    except OSError:
        pass
    try:
        yield
    except OSError as reason:
        said = reason.strerror or reason
        raise ProblemError(f"the {what} {path} cannot be {done}: {said}") from reason


def _sealed(content: Mapping[str, Any]) -> bytes:
    buffer = BytesIO()
    np.savez_compressed(buffer, **content)
    with ZipFile(buffer, "a") as file:
        file.comment = _MARK + b"0" * _DIGEST
    body = buffer.getvalue()[:-_DIGEST]
    return body + sha256(body).hexdigest().encode()


def _check_seal(content: bytes) -> None:
    """Refuse what is not as it was written, as far as that can be known."""
    if not content.startswith(b"PK"):
        raise ValueError("it is no archive")
    if seal := _SEAL.search(content, max(0, len(content) - len(_MARK) - _DIGEST)):
        if sha256(content[:-_DIGEST]).hexdigest().encode() != seal[1]:
            raise ValueError("it is damaged, its checksum does not fit")
    elif not _NO_COMMENT.search(content, max(0, len(content) - 22)):
        raise ValueError("it is damaged or cut off, its end is missing")


def _advice(content: bytes) -> str:
    count = sum(1 for _ in _whole(content))
    return f". {count} of its arrays are whole: ocp.whole_arrays(path) reads them" if count else ""


def _whole(content: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of every entry that is whole, whatever is around it."""
    listed = set(_listed(content))
    for place in re.finditer(rb"PK\x03\x04", content):
        at = place.start()
        if len(content) < at + _ENTRY.size:
            return
        _, *_, checksum, _, _, length, extra = _ENTRY.unpack_from(content, at)
        begin = at + _ENTRY.size
        name, packed = content[begin : begin + length], content[begin + length + extra :]
        if not listed or (at, checksum, name) in listed:
            with suppress(zlib.error, UnicodeDecodeError):
                array = zlib.decompressobj(-zlib.MAX_WBITS).decompress(packed)
                if zlib.crc32(array) == checksum and array.startswith(MAGIC_PREFIX):
                    yield name.decode().removesuffix(".npy"), array


def _listed(content: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield place, checksum and name of every entry in the table at the end, where it is there."""
    for place in re.finditer(rb"PK\x01\x02", content):
        begin = place.start() + _LISTED.size
        if len(content) >= begin:
            _, *_, checksum, _, _, length, _, _, at = _LISTED.unpack_from(content, place.start())
            yield at, checksum, content[begin : begin + length]
