"""A page of the documentation: its code, what it is said to print, and its pictures."""

import re
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from itertools import zip_longest
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

DOCS = Path(__file__).parents[2] / "docs"
#: Pages whose code runs from the first line to the last.
WHERE = ("learn/*.md", "gallery/*.md", "pictures.md")
# A block of code and the text behind it, which is what it prints; or a picture; or such a text
# alone.
_PART = re.compile(
    r"```python\n(?P<code>.*?)```(?:\s*```text\n(?P<said>.*?)```)?"
    r"|!\[[^]]*\]\((?:\.\./)?_static/pages/(?P<file>[\w.-]+)\)"
    r"|(?P<alone>```text\n)",
    re.DOTALL,
)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
# Numbers that a page shows may differ by this, relative and absolute, from machine to machine.
_RELATIVE, _ABSOLUTE = 1e-3, 1e-6


@dataclass(frozen=True)
class Printed:
    """What a block of code printed.

    Attributes:
        text: what it printed.
        said: what the page says that it prints; empty: nothing is said.
    """

    text: str
    said: str

    @property
    def difference(self) -> str:
        """The first line of which the page says something else; empty: none.

        Numbers within a thousandth are the same; "..." at the end of a line stands for anything.
        """
        if not self.said:
            return ""
        lines = (self.said.splitlines(), self.text.splitlines())
        for said, printed in zip_longest(*lines, fillvalue=""):
            if not _is_same(said.rstrip(), printed.rstrip()):
                return f"the page says: {said}\nit prints:     {printed}"
        return ""


@dataclass(frozen=True)
class Shown:
    """A picture.

    Attributes:
        file: its name.
        figure: what the code above it calls ``picture``.
    """

    file: str
    figure: Figure


@dataclass(frozen=True)
class Page:
    """A page whose code runs.

    Attributes:
        name: folder and file without its ending, ``learn/1-a-first-problem``.
        text: the page.
    """

    name: str
    text: str

    @property
    def pictures(self) -> tuple[str, ...]:
        """Files of the pictures that it shows."""
        return tuple(part["file"] for part in _PART.finditer(self.text) if part["file"])

    def run(self) -> Iterator[Printed | Shown]:
        """Run the code in the current folder, as one program; yield what it prints and draws.

        A picture above all code is what ``picture`` is at the end of the page.
        What is called so below is forgotten when it was shown.

        Raises:
            TypeError: if ``picture`` is no figure where one is shown.
            ValueError: if a block of text does not stand directly below a block of code.
        """
        names: dict[str, Any] = {"__name__": self.name}
        on_top = []
        has_run = False
        for part in _PART.finditer(self.text):
            if part["alone"]:
                line = self.text.count("\n", 0, part.start()) + 1
                raise ValueError(f"{self.name}, line {line}: nothing above this text prints it")
            if part["file"] and not has_run:
                on_top.append(part["file"])
                continue
            if part["file"]:
                yield _shown(part["file"], names.pop("picture", None))
                continue
            has_run = True
            printed = StringIO()
            with redirect_stdout(printed):
                exec(compile(part["code"], self.name, "exec"), names)
            yield Printed(printed.getvalue(), part["said"] or "")
        for file in on_top:
            yield _shown(file, names.get("picture"))


def pages() -> tuple[Page, ...]:
    """Return all pages whose code runs."""
    files = [path for where in WHERE for path in sorted(DOCS.glob(where))]
    return tuple(
        Page(str(f.relative_to(DOCS).with_suffix("")), f.read_text(encoding="utf-8")) for f in files
    )


def _shown(file: str, picture: Any) -> Shown:
    if not isinstance(picture, Figure):
        raise TypeError(f"{file}: picture is a {type(picture).__name__}, no figure")
    return Shown(file, picture)


def _is_same(said: str, printed: str) -> bool:
    if said.endswith("..."):
        *words, last = _words(said.removesuffix("..."))
        others = _words(printed)[: len(words) + 1]
        return others[:-1] == words and others[-1].startswith(last)
    if _words(said) != _words(printed):
        return False
    pairs = zip(*(map(float, _NUMBER.findall(line)) for line in (said, printed)), strict=True)
    return all(abs(a - b) <= _RELATIVE * abs(a) + _ABSOLUTE for a, b in pairs)


def _words(line: str) -> list[str]:
    """Return what stands between the numbers."""
    return [word.strip() for word in _NUMBER.split(line)]
