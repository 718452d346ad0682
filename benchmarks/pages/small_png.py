"""Figures as small files: drawings have few colours."""

import io
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

_DPI, _COLOURS = 75, 64


def write_small(figure: Figure, file: Path) -> None:
    """Write a figure as a PNG with few colours."""
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=_DPI, format="png")
    with Image.open(drawn) as image:
        image.convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)
