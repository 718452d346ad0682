"""The example in docs/mpc.md runs and does what the page says."""

from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "mpc.md"


def test_the_example_runs(tmp_path, monkeypatch, capsys) -> None:
    page = PAGE.read_text(encoding="utf-8")
    code = page.split("```python\n")[1].split("```")[0]
    monkeypatch.chdir(tmp_path)
    exec(compile(code, str(PAGE), "exec"), {"__name__": "example"})
    said = capsys.readouterr().out
    assert "replayed to the last bit: True" in said
    assert "'speed' is violated" in said
    assert said.splitlines()[0] == "OPTIMAL         39"


@pytest.mark.slow
def test_the_balloon_keeps_its_limit_by_a_cushion_only(capsys) -> None:
    section = PAGE.read_text(encoding="utf-8").split("### A limit, a disturbance")[1]
    code = section.split("```python\n")[1].split("```")[0]
    exec(compile(code, str(PAGE), "exec"), {"__name__": "example"})
    hard, soft = capsys.readouterr().out.splitlines()
    assert "least_violating" in hard
    assert "nothing violated, 150 optimal>" in soft
    assert float(soft.split("highest ")[1].split()[0]) < 10.5
