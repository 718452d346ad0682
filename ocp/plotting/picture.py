"""A figure whose axes are found by the names of what is drawn in them."""

import io
import re
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.container import Container
from matplotlib.figure import Figure

from ocp.checks.errors import ProblemError

# The colours of Okabe and Ito that stand out on white: told apart by the colour-blind.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
#: The label of what stands in no legend; matplotlib's own word.
NO_LABEL = "_nolegend_"
# What matplotlib calls artists without a label.
_AUTOMATIC = re.compile(r"_child\d+")
_ONE_COLUMN, _TWO_COLUMNS = 6, 16
_WIDTHS = {1: 8.0, 2: 13.0, 3: 18.0}
_LINE = 18
# Width of a letter of the title [pt].
_TITLE_LETTER = 7.0


class Picture(Figure):
    """A matplotlib ``Figure``; ``picture["speed"]`` are the ``Axes`` that show the speed.

    No window and no pyplot state knows of it. Save it with ``savefig``; a notebook shows it.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """Begin an empty one."""
        super().__init__(*args, **kwargs)
        self._shown: dict[str, Axes] = {}

    def __getitem__(self, name: str) -> Axes:
        """Return the axes in which something of this name is drawn.

        Raises:
            ProblemError: with the names that there are.
        """
        if name not in self._shown:
            raise ProblemError(f"picture: '{name}' is not drawn; what is: {', '.join(self._shown)}")
        return self._shown[name]

    def __repr__(self) -> str:
        """Return what it shows."""
        return f"<Picture of {', '.join(self._shown)}>"

    @property
    def names(self) -> tuple[str, ...]:
        """Of all that is drawn."""
        return tuple(self._shown)

    def show_in(self, axes: Axes, names: Iterable[str]) -> None:
        """Note that something is drawn in some axes."""
        for name in names:
            self._shown.setdefault(name, axes)

    def _repr_png_(self) -> bytes:
        """Return the picture for a notebook."""
        file = io.BytesIO()
        self.savefig(file, format="png", dpi=90)
        return file.getvalue()


def laid_out(labels: Sequence[str]) -> tuple[Picture, list[Axes]]:
    """Return a picture with as many axes as labels, in columns from top to bottom."""
    count = len(labels)
    columns = 1 if count <= _ONE_COLUMN else 2 if count <= _TWO_COLUMNS else 3
    rows = -(-count // columns)
    height = 1.1 + max(1.45 * rows, 2.2)
    picture = Picture(figsize=(_WIDTHS[columns], height), layout="constrained")
    picture.get_layout_engine().set(h_pad=0.05, hspace=0.03)  # type: ignore[union-attr]
    grid = picture.subplots(rows, columns, sharex=True, squeeze=False)
    axes = list(grid.T.ravel())
    for spare in axes[count:]:
        spare.remove()
    for ax, label in zip(axes, labels, strict=False):
        ax.set_ylabel(wrapped(label))
        ax.grid(alpha=0.25, linewidth=0.6)
        ax.spines[["top", "right"]].set_visible(False)
    for ax in axes[rows - 1 : count : rows] + axes[count - 1 : count]:
        ax.xaxis.set_tick_params(labelbottom=True)
    picture.align_ylabels()
    return picture, axes[:count]


def name_axis(axes: Sequence[Axes], label: str) -> None:
    """Write what the horizontal axis is under the lowest axes of each column."""
    rows = axes[0].get_gridspec().nrows  # type: ignore[union-attr]
    for ax in {*axes[rows - 1 :: rows], axes[-1]}:
        ax.set_xlabel(wrapped(label, 60))


def write_title(picture: Picture, title: str, *, is_good: bool) -> None:
    """Write a title as wide as the picture is; in red where something went wrong."""
    width = int(72.0 * picture.get_size_inches()[0] / _TITLE_LETTER)
    colour = "black" if is_good else "#B03A00"
    picture.suptitle(wrapped(title, width), fontsize="large", color=colour)


def legend(axes: Axes) -> None:
    """Put a legend to the right, where it hides nothing; each name stands in it once."""
    found: dict[str, Artist | Container] = {}
    drawn = {*axes.lines, *axes.patches, *axes.collections}
    in_order = [artist for artist in axes.get_children() if artist in drawn]
    for artist in (*in_order, *axes.containers):
        name = str(artist.get_label() or NO_LABEL)
        # matplotlib itself would leave out every name that begins with an underscore.
        if name != NO_LABEL and not _AUTOMATIC.fullmatch(name):
            found.setdefault(name, artist)
    if found:
        axes.legend(
            list(found.values()),
            [wrapped(name, 26) for name in found],
            loc="center left",
            bbox_to_anchor=(1.005, 0.5),
            frameon=False,
            fontsize="small",
            labelspacing=0.3,
            handlelength=1.6,
        )


def wrapped(text: str, width: int = _LINE) -> str:
    """Return a text in lines that are not longer than ``width``, where its words allow it.

    A dollar in a name is a dollar, and begins no formula.
    """
    text = text.replace("$", r"\$")
    lines = [textwrap.fill(line, width, break_long_words=False) for line in text.split("\n")]
    return "\n".join(lines)


def finite_range(values: Iterable[np.ndarray]) -> tuple[float, float]:
    """Return the smallest and the largest finite value; 0 and 0 where there is none."""
    rows = np.concatenate([np.ravel(v) for v in values] or [np.zeros(0)])
    rows = rows[np.isfinite(rows)]
    return (float(rows.min()), float(rows.max())) if rows.size else (0.0, 0.0)
