"""The examples of the page on obstacles in space run as they are printed."""

import re
from pathlib import Path

import pytest

from ocp import evaluate

PAGE = Path(__file__).parent.parent / "docs" / "obstacles.md"


def test_the_examples_do_what_the_page_says() -> None:
    names: dict = {}
    for code in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(code, PAGE.name, "exec"), names)
    assert names["solution"].status.is_success
    assert names["solution"].iterations < 40
    assert names["verdict"].violation <= 1e-3
    assert names["verdict"].cost == pytest.approx(7.84, abs=0.01)
    assert names["aside"].status.is_success
    assert evaluate(names["aside"]).violation <= 1e-6
    assert names["depth"] == pytest.approx(-0.6)
