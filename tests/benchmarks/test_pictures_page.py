"""The pictures of the page about pictures are those that its code draws."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.pictures.page import PAGE, draw_page

STATIC = PAGE.parent / "_static"
# Two versions of a font library may draw a letter differently, or a title in another place.
ALIKE = 0.9


@pytest.mark.slow
def test_the_page_draws_what_it_shows(tmp_path: Path) -> None:
    drawn = list(draw_page(PAGE, tmp_path))
    assert {file.name for file in drawn} == {file.name for file in STATIC.glob("picture-*.png")}
    for file in drawn:
        with Image.open(file) as new, Image.open(STATIC / file.name) as kept:
            assert np.abs(np.subtract(new.size, kept.size)).max() <= 2, file.name
            same = np.asarray(new.convert("L").resize(kept.size)) == np.asarray(kept.convert("L"))
        assert same.mean() > ALIKE, f"{file.name}: run `python -m benchmarks pictures` again"
        assert (STATIC / file.name).stat().st_size < 60_000


def test_a_page_that_shows_no_figure_is_refused(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "```python\npicture = 3\n```\n\n![three](_static/three.png)\n", encoding="utf-8"
    )
    with pytest.raises(TypeError, match=r"three\.png: picture is a int, no figure"):
        list(draw_page(page, tmp_path / "out"))
