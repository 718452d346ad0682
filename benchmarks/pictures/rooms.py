"""The rooms of the packages and the floors they stand on, read from the import law."""

import ast
import tomllib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from ocp.internal import replacing

_ROOT = Path(__file__).parents[2]
# The packages from the top down, with how dark their rooms are.
_PACKAGES = (("benchmarks", 0.12), ("solvers", 0.22), ("ocp", 0.32))
_FILL, _EDGE = "#2f7fb8", "#16306e"
_HEIGHT, _GAP, _NARROWEST = 0.72, 0.018, 0.08


class Room(NamedTuple):
    """A folder, or a file beside the folders, of a package.

    Attributes:
        package: whose.
        floor: 1 at the bottom; what it imports lies below it.
        name: of the folder or file.
    """

    package: str
    floor: int
    name: str

    @property
    def files(self) -> list[Path]:
        """Its files."""
        folder = _ROOT / self.package / self.name
        return sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]

    @property
    def lines(self) -> int:
        """Lines of all of them."""
        return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in self.files)

    @property
    def about(self) -> str:
        """The first line of what the room says of itself."""
        said = ast.get_docstring(ast.parse(self.files[0].read_text(encoding="utf-8"))) or ""
        return said.splitlines()[0] if said else ""


def rooms() -> tuple[Room, ...]:
    """Return all rooms, from the top down."""
    return tuple(room for package, _ in _PACKAGES for room in _rooms_of(package))


def rooms_picture(out: Path) -> Path:
    """Draw a band for each package, the rooms of a floor side by side; return the file.

    Args:
        out: folder.
    """
    heights = [max(r.floor for r in _rooms_of(package)) for package, _ in _PACKAGES]
    picture = Figure(figsize=(11.0, 0.52 * sum(heights) + 0.4), layout="constrained")
    bands = picture.subplots(len(_PACKAGES), 1, gridspec_kw={"height_ratios": heights})
    for (package, shade), height, axes in zip(_PACKAGES, heights, bands, strict=True):
        _draw(axes, package, _rooms_of(package), height, shade)
    out.mkdir(parents=True, exist_ok=True)
    file = out / "rooms.png"
    with replacing(file) as draft:
        picture.savefig(draft, dpi=100)
    return file


def _rooms_of(package: str) -> list[Room]:
    law = tomllib.loads((_ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = law["tool"]["importlinter"]["contracts"]
    layers = next(c["layers"] for c in contracts if c.get("containers") == [package])
    return [
        Room(package, len(layers) - i, name.strip())
        for i, layer in enumerate(layers)
        for name in layer.split("|")
    ]


def _draw(axes: Axes, package: str, rooms: list[Room], height: int, shade: float) -> None:
    for floor in range(1, height + 1):
        names = [room.name for room in rooms if room.floor == floor]
        widths = np.maximum([0.0098 * len(name) + 0.024 for name in names], _NARROWEST)
        left = 0.5 - (widths.sum() + _GAP * (len(names) - 1)) / 2
        for name, width in zip(names, widths, strict=True):
            box = FancyBboxPatch(
                (left, floor - 1 + (1 - _HEIGHT) / 2),
                width,
                _HEIGHT,
                boxstyle="round,pad=0,rounding_size=0.012",
                mutation_aspect=12.0,
                facecolor=(*to_rgb(_FILL), shade),
                edgecolor=_EDGE,
                linewidth=0.8,
            )
            axes.add_patch(box)
            axes.text(left + width / 2, floor - 0.5, name, ha="center", va="center", fontsize=9)
            left += width + _GAP
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, height), xticks=[], yticks=[])
    axes.spines[:].set_color("0.8")
    axes.set_ylabel(package, fontsize=11)
