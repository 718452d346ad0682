"""How the curves of one panel are drawn: lines, limits, references and points."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from ocp.plotting.curve import Curve, Limit, Points
from ocp.plotting.picture import finite_range
from ocp.plotting.view import Abscissa

# A limit that is farther from the curve than so many of its spans is named and not drawn.
_NEAR = 0.8
_MARGIN = 0.08
_GREY = "0.35"
SLACK = "#E69F00"


#: Dashes of a line: offset, lengths of dashes and gaps.
Dashes = tuple[float, tuple[float, ...]]
SOLID: Dashes = (0, ())


class Style(NamedTuple):
    """How one run is drawn: in one colour for all, or a colour for each curve."""

    label: str = ""
    line: Dashes = SOLID
    colour: str | None = None


@dataclass(frozen=True, eq=False)
class Drawn:
    """A curve, how it is drawn, and what its horizontal axis is."""

    curve: Curve
    abscissa: Abscissa
    colour: str
    line: Dashes
    label: str


def draw_panel(axes: Axes, drawn: Sequence[Drawn]) -> None:
    """Draw curves with all that belongs to them, and set the limits of the axes."""
    low, high = finite_range(np.array(d.curve.extent) for d in drawn)
    span = (high - low) if high - low > 1e-9 * max(abs(low), abs(high), 1e-9) else 0.0
    limits = [(d, limit) for d in drawn for limit in d.curve.limits]
    near = [_ends_near(limit, low, high, span) for _, limit in limits]
    low, high = finite_range([np.array([low, high]), *[e for ends in near for e in ends]])
    margin = _MARGIN * (high - low) or 0.1 * abs(high) or 1.0
    axes.set_ylim(low - margin, high + margin)
    for d in drawn:
        _draw_curve(axes, d)
    _draw_limits(axes, limits, near, several=len({d.curve.name for d in drawn}) > 1)


def _draw_curve(axes: Axes, d: Drawn) -> None:
    curve, place = d.curve, d.abscissa
    for line in curve.references:
        axes.plot(
            place.at(line.t), line.values, color="black", linestyle=(0, (1, 1.2)),
            linewidth=1.3, label=f"reference: {line.name}", zorder=2.2,
        )  # fmt: skip
    style = {"color": d.colour, "linestyle": d.line, "linewidth": 1.5, "zorder": 2.5}
    axes.plot(place.at(curve.t), curve.values, label=d.label, **style)
    if curve.is_sampled and len(curve.t) <= 160:
        axes.plot(place.at(curve.t), curve.values, ".", color=d.colour, markersize=5)
    for points in curve.points:
        _draw_points(axes, place, points, d.colour)


def _draw_points(axes: Axes, place: Abscissa, points: Points, colour: str) -> None:
    """Draw what was measured with its error, and what is wanted with what is allowed."""
    x, y = place.at(points.t), points.values
    below, above = y - points.lower, points.upper - y
    if points.is_measured:
        axes.errorbar(
            x, y, [below, above], fmt="o", color="black", markersize=3.2, elinewidth=0.8,
            capsize=1.5, markerfacecolor="white", markeredgewidth=0.8, zorder=3,
            label=f"measured: {points.name} ± σ",
        )  # fmt: skip
        return
    label = f"wanted: {points.name}"
    exact = (below == 0.0) & (above == 0.0)
    if exact.any():
        axes.plot(x[exact], y[exact], "D", color="black", markersize=5, markerfacecolor="white",
                  label=label, zorder=3, clip_on=False)  # fmt: skip
        label = f"_{label}"
    for at, low, high in zip(x[~exact], points.lower[~exact], points.upper[~exact], strict=True):
        bottom, top = axes.get_ylim()
        ends = (low if np.isfinite(low) else bottom, high if np.isfinite(high) else top)
        axes.plot([at, at], ends, color="black", linewidth=3.0, alpha=0.55, label=label,
                  solid_capstyle="butt", zorder=2.1)  # fmt: skip
        for end in (low, high):
            if np.isfinite(end):
                axes.plot([at], [end], "_", color="black", markersize=9, zorder=3, clip_on=False)
        label = f"_{label}"


# -- limits ---------------------------------------------------------------------------


def _ends_near(limit: Limit, low: float, high: float, span: float) -> list[np.ndarray]:
    """Return the finite values of those ends that are drawn."""
    reach = _NEAR * span if span else np.inf
    found = []
    for end in (limit.lower, limit.upper):
        values = end[np.isfinite(end)]
        if values.size and values.max() >= low - reach and values.min() <= high + reach:
            found.append(np.clip(values, low - reach, high + reach))
        else:
            found.append(np.zeros(0))
    return found


def _draw_limits(
    axes: Axes,
    limits: Sequence[tuple[Drawn, Limit]],
    near: Sequence[list[np.ndarray]],
    *,
    several: bool,
) -> None:
    """Draw limits once each: grey and hatched, or in the colour of one of several curves."""
    same = _all_alike(limits)
    done: set[tuple[tuple[float, ...], str]] = set()
    for (d, limit), ends in zip(limits, near, strict=True):
        signature = (_summary(limit), d.curve.name if several and not same else "")
        if signature in done:
            continue
        done.add(signature)
        colour = d.colour if several and not same else _GREY
        x, bottom_top = d.abscissa.at(d.curve.t), axes.get_ylim()
        beyond = 20.0 * (bottom_top[1] - bottom_top[0])
        for end, shown, sign in zip((limit.lower, limit.upper), ends, (-1, 1), strict=True):
            if shown.size:
                label = f"{d.curve.name}: {limit.name}" if several and not same else limit.name
                _draw_end(axes, x, end, sign * beyond, limit, colour, label,
                          hatched=d.abscissa.is_time and colour == _GREY)  # fmt: skip
            elif np.isfinite(end).any():
                _name_end(axes, end, sign, d.curve.name if several and not same else "")
        if limit.is_soft:
            _draw_slack(axes, x, d.curve.values, limit)


def _draw_end(
    axes: Axes,
    x: np.ndarray,
    end: np.ndarray,
    beyond: float,
    limit: Limit,
    colour: str,
    label: str,
    *,
    hatched: bool,
) -> None:
    end = np.where(np.isfinite(end), end, np.nan)
    style = (0, (5, 2)) if limit.is_soft else "-"
    said = f"{label} (soft)" if limit.is_soft else label
    axes.plot(x, end, color=colour, linestyle=style, linewidth=0.9, label=said, zorder=2.0)
    if hatched:
        axes.fill_between(
            x, end, end + beyond, facecolor="none", edgecolor="0.78", hatch="////",
            linewidth=0.0, zorder=0.6,
        )  # fmt: skip


def _draw_slack(axes: Axes, x: np.ndarray, values: np.ndarray, limit: Limit) -> None:
    """Colour what is beyond a soft limit."""
    inside = np.clip(values, limit.lower, limit.upper)
    if (inside != values).any():
        axes.fill_between(x, inside, values, color=SLACK, alpha=0.55, linewidth=0.0, zorder=1.5,
                          label="slack in use")  # fmt: skip


def _name_end(axes: Axes, end: np.ndarray, sign: int, owner: str) -> None:
    """Say in the legend where a limit is that is off the scale."""
    values = end[np.isfinite(end)]
    value = values.min() if sign > 0 else values.max()
    text = f"{owner} {'≤' if sign > 0 else '≥'} {value:.4g}".strip()
    axes.plot([], [], linestyle="none", label=f"{text} (off scale)")


def _summary(limit: Limit) -> tuple[float, ...]:
    """What tells limits apart: each end at both ends of the curve, and its mean."""
    found: list[float] = []
    for end in (limit.lower, limit.upper):
        mean = float(np.where(np.isfinite(end), end, 0.0).mean())
        found += [float(end[0]), float(end[-1]), round(mean, 9)]
    return tuple(found)


def _all_alike(limits: Sequence[tuple[Drawn, Limit]]) -> bool:
    by_curve: dict[str, set[tuple[float, ...]]] = {}
    for d, limit in limits:
        by_curve.setdefault(d.curve.name, set()).add(_summary(limit))
    return len({frozenset(found) for found in by_curve.values()}) <= 1
