"""Every answer of the page "How do I write ..." runs as it stands there."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parent.parent / "docs" / "how-do-i-write.md"
_BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)


def _sections() -> dict[str, str]:
    """Return the code under each heading; the first is what all begin with."""
    text = PAGE.read_text(encoding="utf-8")
    head, *parts = re.split(r"^## (.*)\n", text, flags=re.MULTILINE)
    pairs = zip(parts[::2], parts[1::2], strict=True)
    return {"": head} | dict(pairs)


def _code(section: str) -> str:
    return "\n".join(_BLOCK.findall(section))


SECTIONS = _sections()
# One answer goes on from another.
_IN_STEPS = "... a model in discrete time?"
BEFORE = {
    "... a price and a bound of how fast the input changes?": _IN_STEPS,
    "... an input that acts later?": _IN_STEPS,
}


def test_there_are_twenty_answers() -> None:
    assert len(SECTIONS) - 1 >= 20
    assert all(_code(section) for section in SECTIONS.values())


@pytest.mark.many
@pytest.mark.parametrize("heading", [name for name in SECTIONS if name])
def test_it_runs(heading: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # one of them writes a file
    names: dict[str, object] = {}
    for part in ("", BEFORE.get(heading, ""), heading):
        if part or not names:
            exec(_code(SECTIONS[part]), names)
