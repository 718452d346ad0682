"""The README's examples run as they are printed."""

import re
from pathlib import Path

import pytest

README = Path(__file__).parent.parent / "README.md"


@pytest.fixture
def names(tmp_path, monkeypatch) -> dict:
    """What the examples, one after the other, leave behind; their files are in ``tmp_path``."""
    monkeypatch.chdir(tmp_path)
    found: dict = {}
    for code in re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(code, "README.md", "exec"), found)
    return found


def test_the_readmes_examples_do_what_they_say(names, tmp_path):
    direct, gradient, extremal = (names[n] for n in ("direct", "gradient", "extremal"))
    assert extremal.status.name == "SOLVED"
    costs = [names["evaluate"](s).cost for s in (direct, gradient, extremal)]
    assert costs == pytest.approx([costs[2]] * 3, rel=1e-3)
    rollout = names["rollout"]
    assert repr(rollout).endswith("nothing violated, 80 optimal>")
    assert rollout.violation == 0.0
    for picture in ("swing.png", "loop.png"):
        assert (tmp_path / picture).stat().st_size > 10_000


def test_readme_image_is_there():
    for file in re.findall(r"!\[.*?\]\((.*?)\)", README.read_text(encoding="utf-8")):
        assert (README.parent / file).exists()
