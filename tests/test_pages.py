"""Pages whose code runs print what they say, and show the pictures that their code draws."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.pages.page import DOCS, Page, Printed, Shown, pages
from benchmarks.pages.small_png import write_small

PAGES = pages()
KEPT = DOCS / "_static" / "pages"
# Two versions of a font library may draw a letter differently, or a title in another place.
ALIKE = 0.9


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(p, marks=[pytest.mark.slow] if p.name.startswith("gallery/") else [])
        for p in PAGES
    ],
    ids=lambda page: page.name,
)
def test_it_prints_and_draws_what_it_says(page: Page, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for part in page.run():
        if isinstance(part, Printed):
            assert not part.difference, part.difference
        else:
            drawn = tmp_path / part.file
            write_small(part.figure, drawn)
            assert _alike(drawn, KEPT / part.file), "run `python -m benchmarks pages` again"


def _alike(one: Path, other: Path) -> bool:
    with Image.open(one) as new, Image.open(other) as kept:
        if np.abs(np.subtract(new.size, kept.size)).max() > 2:
            return False
        same = np.asarray(new.convert("L").resize(kept.size)) == np.asarray(kept.convert("L"))
    return bool(same.mean() > ALIKE)


def test_all_pictures_are_shown_and_small() -> None:
    files = {file.name: file.stat().st_size for file in KEPT.glob("*.png")}
    assert set(files) == {file for page in PAGES for file in page.pictures}
    assert max(files.values()) < 60_000


def test_there_are_pages() -> None:
    assert sum(page.name.startswith("learn/") for page in PAGES) == 5


def test_a_page_that_shows_no_figure_is_refused() -> None:
    page = Page("three", "```python\npicture = 3\n```\n\n![three](_static/pages/three.png)\n")
    with pytest.raises(TypeError, match=r"three\.png: picture is a int, no figure"):
        list(page.run())


def test_a_picture_is_what_is_called_so_above_it() -> None:
    code = "from matplotlib.figure import Figure\npicture = Figure()\nprint(1)"
    page = Page("one", f"```python\n{code}\n```\n\n![one](../_static/pages/one.png)\n")
    printed, shown = page.run()
    assert printed == Printed("1\n", "")
    assert isinstance(shown, Shown)
    assert shown.file == "one.png"


def test_a_picture_above_all_code_is_what_is_called_so_at_its_end() -> None:
    code = "from matplotlib.figure import Figure\npicture = Figure()"
    page = Page("top", f"![top](../_static/pages/top.png)\n\n```python\n{code}\n```\n")
    _, shown = page.run()
    assert isinstance(shown, Shown)
    assert shown.file == "top.png"


def test_a_picture_is_shown_once() -> None:
    code = "from matplotlib.figure import Figure\npicture = Figure()"
    shown = "![one](_static/pages/one.png)\n"
    page = Page("one", f"```python\n{code}\n```\n\n{shown}\n```python\nx = 1\n```\n\n{shown}")
    with pytest.raises(TypeError, match=r"one\.png: picture is a NoneType"):
        list(page.run())


def test_a_text_that_no_code_prints_is_refused() -> None:
    page = Page("one", "```python\nprint(1)\n```\n\n```text\n1\n```\n\nand\n\n```text\n2\n```\n")
    with pytest.raises(ValueError, match="one, line 11: nothing above this text prints it"):
        list(page.run())


@pytest.mark.parametrize(
    ("said", "printed", "same"),
    [
        ("cost 1.2345 s", "cost 1.2346 s", True),
        ("cost 1.2345 s", "cost 1.2445 s", False),
        ("cost 1.2345 s", "price 1.2345 s", False),
        ("violated by ...", "violated by 163 at t = 30 s", True),
        ("violated by ...", "not violated", False),
        ("one", "one\ntwo", False),
        ("1e-9 of it", "3e-10 of it", True),
        ("[1 2]", "[1 2 3]", False),
    ],
)
def test_numbers_may_differ_by_a_thousandth_and_words_may_not(said, printed, same) -> None:
    assert (not Printed(printed, said).difference) is same
