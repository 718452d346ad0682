"""A plot as part of a page: drawn by matplotlib, coloured by the page, with its data."""

import io
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import (
    FixedFormatter,
    FixedLocator,
    FuncFormatter,
    LogLocator,
    NullFormatter,
    NullLocator,
)

from benchmarks.report.sheet import Sheet

# Narrow enough to be read on a phone; a wide window shows two side by side.
_WIDTH = 4.9  # [inches of 72 units]
COLOURS = 10
# Stand-ins: the page replaces them by colours that suit its light or dark theme.
TEXT, _GRID = "#010203", "#030201"
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "text.parse_math": False,
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    **dict.fromkeys(("text.color", "axes.labelcolor", "xtick.color", "ytick.color"), TEXT),
    "axes.edgecolor": _GRID,
    "grid.color": _GRID,
    "axes.axisbelow": True,
    "axes.grid": True,
}
_UP = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Legend:
    """A method and the number of its colour."""

    label: str
    colour: int

    @property
    def style(self) -> str:
        """Of the piece of line beside the label, in CSS."""
        line = ("solid", "dashed", "dotted", "dashed")[self.colour // COLOURS % 4]
        return f"color: var(--s{self.colour % COLOURS}); border-top-style: {line}"


@dataclass(frozen=True)
class Plot:
    """A drawn plot.

    Attributes:
        name: unique on the page.
        title: what is shown, as a sentence that can stand alone.
        svg: the drawing.
        data: what is drawn, number by number.
        legend: empty where the axes name the methods themselves.
    """

    name: str
    title: str
    svg: str
    data: Sheet
    legend: Sequence[Legend] = ()
    kind = "plot"


def drawn(name: str, height: float, draw: Callable[[Axes], None]) -> str:
    """Return a drawing as an SVG element without a single address or fixed colour.

    Args:
        name: unique on the page, without two hyphens in a row; its ids begin with it and these.
        height: [inches].
        draw: draws onto empty axes.
    """
    text = io.StringIO()
    with rc_context({**_STYLE, "svg.hashsalt": name}):
        figure = Figure(figsize=(_WIDTH, height), layout="constrained")
        draw(figure.add_subplot())
        nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        figure.savefig(text, format="svg", transparent=True, metadata=nothing)
    return _fitted(text.getvalue(), name)


def colour(number: int) -> str:
    """Return the stand-in of a method's colour."""
    return f"#0a5e{number % COLOURS:02x}"


def dashes(number: int) -> str:
    """Return a line style: another one when the colours begin again."""
    return ("-", "--", ":", "-.")[number // COLOURS % 4]


def as_series(artists: Iterable, number: int) -> None:
    """Name what is drawn for a method, so that its legend can point at it."""
    for artist in artists:
        artist.set_gid(f"series-{number}")


def powers_of_ten(axis: Axis) -> None:
    """Write the numbers of a logarithmic axis as small as they are; its limits are set."""
    low, high = axis.get_view_interval()
    # Where hardly two powers of ten are in view, other numbers help.
    between = (1.0, 2.0, 5.0) if high < 50.0 * low else (1.0,)
    axis.set_major_locator(LogLocator(subs=between))
    named = power_of_ten if len(between) == 1 else "{:g}".format
    axis.set_major_formatter(FuncFormatter(lambda value, _: named(value)))
    axis.set_minor_formatter(NullFormatter())


def power_of_ten(value: float) -> str:
    """Return 0.001 as 10⁻³; what is no power of ten, or a small one, as it is."""
    digits, _, exponent = f"{value:e}".partition("e")
    if float(digits) != 1.0 or abs(int(exponent)) < 2:
        return f"{value:g}"
    return f"10{str(int(exponent)).translate(_UP)}"


def named_ticks(axis: Axis, names: Sequence[str]) -> None:
    """Give the ticks 0, 1, ... names; characters that control something are not drawn."""
    shown = ["".join(c if c.isprintable() else "\ufffd" for c in name) for name in names]
    axis.set_major_locator(FixedLocator(range(len(names))))
    axis.set_major_formatter(FixedFormatter(shown))
    axis.set_minor_locator(NullLocator())


def _fitted(svg: str, name: str) -> str:
    """Make a file of matplotlib part of a page."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(
        r'<svg [^>]*?viewBox="([^"]*)"[^>]*>', r'<svg viewBox="\1" role="img">', svg, count=1
    )
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="series-(\d+)">', r'<g class="series" data-series="\1">', svg)
    svg = svg.replace("xlink:href", "href").replace('id="matplotlib.', 'id="')
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}--", svg)
    svg = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font: \1 var(--font)", svg)
    svg = svg.replace(TEXT, "currentColor").replace(_GRID, "var(--grid)")
    return re.sub(r"#0a5e([0-9a-f]{2})", lambda found: f"var(--s{int(found[1], 16)})", svg)
