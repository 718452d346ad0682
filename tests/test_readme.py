"""The README's example runs as it is printed."""

import re
from pathlib import Path

import pytest

README = Path(__file__).parent.parent / "README.md"


def example() -> str:
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    return code


def test_readme_example_is_solved(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(compile(example(), "README.md", "exec"), names)
    direct, gradient, extremal = (names[n] for n in ("direct", "gradient", "extremal"))
    assert extremal.status.name == "SOLVED"
    costs = [names["evaluate"](s).cost for s in (direct, gradient, extremal)]
    assert costs == pytest.approx([costs[2]] * 3, rel=1e-3)
    assert (tmp_path / "swing.png").stat().st_size > 10_000


def test_readme_image_is_there():
    for file in re.findall(r"!\[.*?\]\((.*?)\)", README.read_text(encoding="utf-8")):
        assert (README.parent / file).exists()
