"""What a report consists of."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from benchmarks.report.plot import Plot
from benchmarks.report.sheet import Sheet


@dataclass(frozen=True)
class Text:
    """A paragraph, a heading in a section, or what is missing."""

    text: str
    role: Literal["plain", "heading", "missing"] = "plain"
    kind = "text"


@dataclass(frozen=True)
class Points:
    """A list, one sentence each."""

    points: Sequence[str]
    kind = "points"


Block = Text | Points | Sheet | Plot


@dataclass(frozen=True)
class Section:
    """A chapter of the page.

    Attributes:
        name: its address on the page.
        title: as people read it.
        blocks: from top to bottom.
    """

    name: str
    title: str
    blocks: Sequence[Block]


def missing(text: str) -> Text:
    """Say what these rows cannot show, and why."""
    return Text(text, "missing")
