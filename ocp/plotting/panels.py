"""Which curves share a panel: of one kind and unit, of like size and the same limits."""

from collections.abc import Sequence
from dataclasses import dataclass

from ocp.plotting.curve import Curve

# More lines are not told apart, and none may look flat beside the others.
_MOST_LINES, _MOST_SPANS = 6, 5.0
# A curve that varies by less, relative to its size, is a constant.
_FLAT = 1e-9
_PLURAL = {
    "state": "states",
    "control": "controls",
    "algebraic": "algebraic",
    "rate": "rates",
    "costate": "costates",
}


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves in one pair of axes."""

    curves: tuple[Curve, ...]

    @property
    def label(self) -> str:
        """What stands at the vertical axis: the name of one curve, the kind of several."""
        first = self.curves[0]
        if len(self.curves) == 1:
            return f"{first.name}\n[{first.unit}]" if first.unit else first.name
        return f"{_PLURAL.get(first.role, first.role)}\n[{first.unit}]"

    def takes(self, curve: Curve) -> bool:
        """Whether a curve can be read beside those that are there."""
        first = self.curves[0]
        alike = curve.unit and (curve.role, curve.unit) == (first.role, first.unit)
        if not alike or len(self.curves) >= _MOST_LINES or curve.beside or first.beside:
            return False
        if {x.summary for x in curve.limits} != {x.summary for x in first.limits}:
            return False
        ends = [c.extent for c in (*self.curves, curve)]
        low, high = min(e[0] for e in ends), max(e[1] for e in ends)
        spans = [b - a for a, b in ends if b - a > _FLAT * max(abs(a), abs(b))]
        return high - low <= _MOST_SPANS * min(spans, default=high - low)


def panels_of(curves: Sequence[Curve], *, apart: bool = False) -> list[Panel]:
    """Return the panels of some curves; ``apart``: one for each."""
    found: list[Panel] = []
    for curve in curves:
        fits = (k for k, panel in enumerate(found) if not apart and panel.takes(curve))
        k = next(fits, None)
        if k is None:
            found.append(Panel((curve,)))
        else:
            found[k] = Panel((*found[k].curves, curve))
    return found
