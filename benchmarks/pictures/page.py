"""The pictures of a page of the documentation, drawn by the code that stands above them."""

import io
import re
from collections.abc import Iterator
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

PAGE = Path(__file__).parents[2] / "docs" / "pictures.md"
_PARTS = re.compile(
    r"```python\n(?P<code>.*?)```|!\[[^\]]*\]\(_static/(?P<file>[\w.-]+)\)", re.DOTALL
)
# Small files: drawings have few colours.
_DPI, _COLOURS = 75, 64


def draw_page(page: Path, out: Path) -> Iterator[Path]:
    """Run the code of a page; write what it calls ``picture`` where the page shows one.

    Args:
        page: whose code is run, from top to bottom, as one program.
        out: folder of the files, which have the names that the page gives them.
    """
    out.mkdir(parents=True, exist_ok=True)
    names: dict[str, object] = {}
    for part in _PARTS.finditer(page.read_text(encoding="utf-8")):
        if part["code"]:
            exec(part["code"], names)
        else:
            file = out / part["file"]
            _write(names["picture"], file)
            yield file


def _write(picture: object, file: Path) -> None:
    """Write a figure with few colours."""
    if not isinstance(picture, Figure):
        raise TypeError(f"{file.name}: picture is a {type(picture).__name__}, no figure")
    drawn = io.BytesIO()
    picture.savefig(drawn, dpi=_DPI, format="png")
    with Image.open(drawn) as image:
        image.convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)
