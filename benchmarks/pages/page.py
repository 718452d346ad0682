"""A page of the documentation: its code, step by step, and what each step is said to print."""

import re
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from itertools import zip_longest
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
#: Folders of pages whose code runs from the first line to the last.
FOLDERS = ("learn", "gallery")
# A block of code, and the text behind it, which is what it prints.
_STEP = re.compile(r"```python\n(.*?)```(?:\s*```text\n(.*?)```)?", re.DOTALL)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
_PICTURE = re.compile(r"!\[[^]]*\]\((?:\.\./)?_static/pages/([\w-]+\.png)\)")
# Numbers that a page shows may differ by this, relative and absolute, from machine to machine.
_RELATIVE, _ABSOLUTE = 1e-3, 1e-6


@dataclass(frozen=True)
class Step:
    """One block of code.

    Attributes:
        code: Python.
        said: what the page says that it prints; None: nothing is said.
    """

    code: str
    said: str | None


@dataclass(frozen=True)
class Page:
    """A page whose code runs.

    Attributes:
        name: folder and file without its ending, ``learn/1-first-problem``.
        text: the page.
    """

    name: str
    text: str

    @property
    def steps(self) -> tuple[Step, ...]:
        """Its blocks of code."""
        return tuple(Step(code, said or None) for code, said in _STEP.findall(self.text))

    @property
    def pictures(self) -> tuple[str, ...]:
        """Files that its code saves and that it shows."""
        return tuple(_PICTURE.findall(self.text))

    def run(self) -> Iterator[tuple[Step, str]]:
        """Run the code in the current folder; yield each step with what it printed."""
        names: dict[str, object] = {"__name__": self.name}
        for step in self.steps:
            printed = StringIO()
            with redirect_stdout(printed):
                exec(compile(step.code, self.name, "exec"), names)
            yield step, printed.getvalue()


def pages() -> tuple[Page, ...]:
    """Return all pages whose code runs, in the order of their names."""
    files = [path for folder in FOLDERS for path in sorted((DOCS / folder).glob("*.md"))]
    found = [Page(f"{f.parent.name}/{f.stem}", f.read_text(encoding="utf-8")) for f in files]
    return tuple(page for page in found if page.steps)


def difference(said: str, printed: str) -> str:
    """Return the first line of which a page says something else than is printed; empty: none.

    Numbers within a thousandth are the same; "..." at the end of a line stands for anything.
    """
    for is_said, is_printed in zip_longest(said.splitlines(), printed.splitlines(), fillvalue=""):
        if not _is_same(is_said.rstrip(), is_printed.rstrip()):
            return f"the page says: {is_said}\nit prints:     {is_printed}"
    return ""


def _is_same(said: str, printed: str) -> bool:
    if said.endswith("..."):
        *words, last = _words(said.removesuffix("..."))
        others = _words(printed)[: len(words) + 1]
        return others[:-1] == words and others[-1].startswith(last)
    pairs = zip(
        map(float, _NUMBER.findall(said)), map(float, _NUMBER.findall(printed)), strict=False
    )
    near = all(abs(a - b) <= _RELATIVE * abs(a) + _ABSOLUTE for a, b in pairs)
    return near and _words(said) == _words(printed)


def _words(line: str) -> list[str]:
    """Return what stands between the numbers."""
    return [word.strip() for word in _NUMBER.split(line)]
