"""The example in docs/diagnose.md runs and says what the page says."""

from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "diagnose.md"


def test_the_example_runs(capsys) -> None:
    page = PAGE.read_text(encoding="utf-8")
    code = page.split("```python\n")[1].split("```")[0]
    printed = page.split("```text\n")[1].split("```")[0]
    exec(compile(code, str(PAGE), "exec"), {"__name__": "example"})
    assert capsys.readouterr().out.split() == printed.split()
