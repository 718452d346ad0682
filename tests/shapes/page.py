"""The examples of the page on obstacles in space, run as they are printed."""

import re
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parents[2] / "docs" / "obstacles.md"


def names_of_page() -> dict[str, Any]:
    """What the examples, one after the other, leave behind."""
    names: dict[str, Any] = {}
    for code in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(code, PAGE.name, "exec"), names)
    return names
