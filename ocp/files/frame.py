"""Records one after the other in a file, each in a frame: its number, its size, its checksum."""

import re
from collections.abc import Iterator
from struct import Struct
from typing import BinaryIO
from zlib import crc32

_MARK = b"\x89ocp"
# Mark, number, size of the record, its checksum; then the checksum of these.
_HEAD = Struct("<4s3I")
_OWN = Struct("<I")
_SIZE = _HEAD.size + _OWN.size


class BrokenFrame(ValueError):
    """A record that is not as it was written; the text says in what.

    Args:
        why: in words.
        at: the byte where its frame begins, or should.
    """

    def __init__(self, why: str, at: int) -> None:
        """Keep the place."""
        super().__init__(why)
        self.at = at


def framed(number: int, record: bytes) -> bytes:
    """Return a record in its frame."""
    head = _HEAD.pack(_MARK, number, len(record), crc32(record))
    return head + _OWN.pack(crc32(head)) + record


def read_frames(file: BinaryIO) -> Iterator[bytes]:
    """Yield the records from here on; a last one that was cut off is left out.

    Raises:
        BrokenFrame: at the first record that is damaged, or not the next one.
    """
    number, at = 0, file.tell()
    while len(frame := file.read(_SIZE)) == _SIZE:
        head = _head_of(frame)
        if head is None:
            raise BrokenFrame("there is no record", at)
        found, size, checksum = head
        if found != number:
            raise BrokenFrame(f"record {found} follows record {number - 1}", at)
        record = file.read(size)
        if len(record) < size:
            return
        if crc32(record) != checksum:
            raise BrokenFrame("the checksum does not fit", at)
        yield record
        number, at = number + 1, at + _SIZE + size


def whole_frames(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield number and record of every frame that is whole, whatever is between them."""
    end = 0
    for mark in re.finditer(re.escape(_MARK), content):
        begin = mark.start()
        head = _head_of(content[begin : begin + _SIZE])
        if begin < end or head is None:
            continue
        number, size, checksum = head
        record = content[begin + _SIZE : begin + _SIZE + size]
        if len(record) == size and crc32(record) == checksum:
            yield number, record
            end = begin + _SIZE + size


def _head_of(frame: bytes) -> tuple[int, int, int] | None:
    """Return number, size and checksum; None where this is no frame."""
    if len(frame) < _SIZE:
        return None
    mark, *head = _HEAD.unpack_from(frame)
    if mark != _MARK or _OWN.unpack_from(frame, _HEAD.size)[0] != crc32(frame[: _HEAD.size]):
        return None
    return head[0], head[1], head[2]
