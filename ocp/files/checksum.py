"""A JSON object with its checksum, so that a value that has changed is not taken for another."""

import json
import zlib
from collections.abc import Mapping
from typing import Any

CHECKSUM = "crc32"


def with_checksum(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return an object with one more entry: what its values add up to, however they are set out."""
    return {**content, CHECKSUM: _sum(content)}


def without_checksum(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return an object without that entry; one that has none is as older versions wrote it.

    Raises:
        ValueError: if the checksum does not fit.
    """
    rest = {name: value for name, value in content.items() if name != CHECKSUM}
    if CHECKSUM in content and content[CHECKSUM] != _sum(rest):
        raise ValueError("it is damaged: its checksum does not fit")
    if any(map(_was_checksum, rest)):
        raise ValueError("it is damaged: the name of its checksum has changed")
    return rest


def _was_checksum(name: str) -> bool:
    """Whether one letter makes the difference: else a flipped bit would make an older object."""
    apart = [a for a, b in zip(name, CHECKSUM, strict=False) if a != b]
    return len(name) == len(CHECKSUM) and len(apart) == 1


def _sum(content: Mapping[str, Any]) -> str:
    return f"{zlib.crc32(json.dumps(content, sort_keys=True).encode()):08x}"
