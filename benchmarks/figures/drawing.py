"""What every figure is made of: a picture, its data, and a sentence; and how it is written."""

import csv
from collections.abc import Callable, Mapping
from itertools import zip_longest
from pathlib import Path
from textwrap import fill
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Picture

from ocp.internal import replacing

_DPI = 100
# Characters of a caption on an inch of width.
_CAPTION = 14.5
# Blue to yellow for longer and longer horizons; the finite horizon is orange, as in the thesis.
COLOURS = ("#16306e", "#2f7fb8", "#3aa98f", "#9ac43f")
FINITE = "#e8710a"
REFERENCE = {"color": "black", "ls": "--", "lw": 1.0}


class Drawing(NamedTuple):
    """A figure that is drawn.

    Attributes:
        picture: for matplotlib to save.
        columns: the data, by name and unit; a shorter column is filled up with blanks.
        sentence: what one sees, with the parameters that the thesis leaves out.
        film: writes the motion to a GIF, where there is one.
    """

    picture: Picture
    columns: Mapping[str, np.ndarray]
    sentence: str
    film: Callable[[Path], object] | None = None


def write(drawing: Drawing, stem: str, out: Path) -> tuple[Path, Path]:
    """Write picture, data and film, the sentence above the picture; return the first two."""
    out.mkdir(parents=True, exist_ok=True)
    picture, data = out / f"{stem}.png", out / f"{stem}.csv"
    width = int(_CAPTION * drawing.picture.get_figwidth())
    # Spaces that textwrap does not break at: "N = 5" stays together.
    caption = fill(drawing.sentence.replace(" = ", "\u00a0=\u00a0"), width)
    drawing.picture.suptitle(caption, fontsize=9, ha="left", x=0.01)
    with replacing(picture) as draft:
        drawing.picture.savefig(draft, dpi=_DPI)
    with replacing(data) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(drawing.columns)
        columns = [np.asarray(column).tolist() for column in drawing.columns.values()]
        writer.writerows(zip_longest(*columns, fillvalue=""))
    if drawing.film:
        drawing.film(out / f"{stem}.gif")
    return picture, data


def sheet(width: float, height: float) -> Picture:
    """Return an empty picture [inches] that arranges its axes itself."""
    return Picture(figsize=(width, height), layout="constrained")


def label(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Name both axes, say what is shown, and draw a grid behind it."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, fontsize=10)
    axes.grid(alpha=0.3)


def held(axes: Axes, t: np.ndarray, u: np.ndarray, **style: object) -> None:
    """Draw inputs u (K,) that are held between the instants t (K + 1,)."""
    axes.step(t, np.append(u, u[-1]), where="post", **style)  # pyright: ignore[reportArgumentType]
