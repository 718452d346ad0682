"""One quantity over time: its values and limits, what it should follow, what was measured."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

#: What a quantity is. ``"held"`` are controls and rates that are steps.
Role = Literal[
    "state",
    "algebraic",
    "control",
    "rate",
    "signal",
    "constraint",
    "data",
    "invariant",
    "costate",
    "cost",
]

# A limit is touched if the curve comes closer than this part of its span.
_TOUCHED = 1e-3
# What was measured or planned is drawn if it is no farther from everything else, in spans.
_STRAYS = 0.5


@dataclass(frozen=True, eq=False)
class Limit:
    """Lower and upper limit along a curve.

    Attributes:
        name: what says so: a bound, or a constraint.
        lower: (K,), ``-inf``: none.
        upper: (K,), ``inf``: none.
        is_soft: whether it may be exceeded at a price.
    """

    name: str
    lower: np.ndarray
    upper: np.ndarray
    is_soft: bool = False

    @property
    def is_there(self) -> bool:
        """Whether it limits anything."""
        return bool(np.isfinite(self.lower).any() or np.isfinite(self.upper).any())

    @property
    def summary(self) -> tuple[float, ...]:
        """What tells limits apart: each end at both ends of the curve, and its mean."""
        found: list[float] = []
        for end in (self.lower, self.upper):
            mean = float(np.where(np.isfinite(end), end, 0.0).mean())
            found += [float(end[0]), float(end[-1]), round(mean, 9)]
        return tuple(found)

    @property
    def is_equation(self) -> bool:
        """Whether both ends are the same: it is touched wherever it holds."""
        return bool((self.lower == self.upper).any())

    def room(self, values: np.ndarray) -> float:
        """Return the smallest distance from the limit; negative where it is exceeded."""
        return float(np.nanmin([values - self.lower, self.upper - values], initial=np.inf))


@dataclass(frozen=True, eq=False)
class Points:
    """Values at instants: what was measured, with its error, or what a constraint wants.

    Attributes:
        name: of the measurement or of the constraint.
        is_measured: measured, or wanted.
        t: instants [s], (K,).
        values: (K,).
        lower: lower end of the error bar, or of what is allowed, (K,).
        upper: upper end of it, (K,).
    """

    name: str
    is_measured: bool
    t: np.ndarray
    values: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @property
    def extent(self) -> np.ndarray:
        """All finite ends."""
        ends = np.concatenate([self.values, self.lower, self.upper])
        return ends[np.isfinite(ends)]


@dataclass(frozen=True, eq=False)
class Line:
    """A second line beside a curve.

    Attributes:
        name: of it.
        t: instants [s], (K,).
        values: (K,); NaN where there is none.
        kind: what the curve should follow, what was told of it, or what was planned.
    """

    name: str
    t: np.ndarray
    values: np.ndarray
    kind: Literal["reference", "measured", "plan"] = "reference"


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity over time. Where it jumps, an instant stands twice; a gap is NaN.

    Attributes:
        name: what people call it.
        unit: of it; empty: not known.
        role: what it is.
        t: instants [s], (K,).
        values: (K,).
        limits: of it.
        lines: what it should follow, and others beside it.
        points: at instants.
        is_sampled: whether it has values at its instants alone, as a discrete-time state.
    """

    name: str
    unit: str
    role: Role
    t: np.ndarray
    values: np.ndarray
    limits: tuple[Limit, ...] = ()
    lines: tuple[Line, ...] = ()
    points: tuple[Points, ...] = ()
    is_sampled: bool = False

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    @property
    def beside(self) -> bool:
        """Whether anything is drawn beside it."""
        return bool(self.lines or self.points)

    @property
    def extent(self) -> tuple[float, float]:
        """Smallest and largest value of everything but the limits.

        What was measured or planned counts as far as it is near: a broken sensor hides no curve.
        """
        exact = [x.values for x in self.lines if x.kind == "reference"]
        low, high = _range([self.values, *exact, *(p.extent for p in self.points)])
        reach = _STRAYS * (high - low)
        told = [x.values for x in self.lines if x.kind != "reference"]
        near = [v[(v >= low - reach) & (v <= high + reach)] for v in told]
        return _range([np.array([low, high]), *near])

    @property
    def touches_limit(self) -> bool:
        """Whether it comes to one of its limits, or exceeds it; equations do not count."""
        low, high = self.extent
        near = _TOUCHED * (high - low)
        return any(not x.is_equation and x.room(self.values) <= near for x in self.limits)


def one_after_another(parts: Sequence[Curve]) -> Curve:
    """Return the curve of several phases: gaps between them, so that no line joins them."""
    if len(parts) == 1:
        return parts[0]
    limits = list(dict.fromkeys(limit.name for part in parts for limit in part.limits))
    return replace(
        parts[0],
        t=_with_gaps([part.t for part in parts]),
        values=_with_gaps([part.values for part in parts]),
        limits=tuple(_joined_limit(name, parts) for name in limits),
        lines=tuple(line for part in parts for line in part.lines),
        points=tuple(p for part in parts for p in part.points),
    )


def _joined_limit(name: str, parts: Sequence[Curve]) -> Limit:
    """Return the limit of a name along all phases; none in the phases that do not have it."""
    each = [next((x for x in part.limits if x.name == name), _no_limit(part)) for part in parts]
    lower, upper = (_with_gaps(ends) for ends in ([x.lower for x in each], [x.upper for x in each]))
    return Limit(name, lower, upper, any(x.is_soft for x in each))


def _no_limit(part: Curve) -> Limit:
    ends = np.full(len(part.t), np.inf)
    return Limit("", -ends, ends)


def _range(values: Sequence[np.ndarray]) -> tuple[float, float]:
    rows = np.concatenate(values)
    rows = rows[np.isfinite(rows)]
    return (float(rows.min()), float(rows.max())) if rows.size else (0.0, 0.0)


def _with_gaps(rows: Sequence[np.ndarray]) -> np.ndarray:
    found = [part for row in rows for part in (row, [np.nan])]
    return np.concatenate(found[:-1])
