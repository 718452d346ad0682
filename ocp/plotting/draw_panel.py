"""How the curves of one panel are drawn: lines, limits, references and points."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from ocp.plotting.curve import Curve, Limit, Line, Points
from ocp.plotting.picture import NO_LABEL, finite_range
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
    _draw_limits(axes, limits, near)


def _draw_curve(axes: Axes, d: Drawn) -> None:
    curve, place = d.curve, d.abscissa
    for line in curve.lines:
        _draw_line(axes, place, line, d.colour)
    style = {"color": d.colour, "linestyle": d.line, "linewidth": 1.5, "zorder": 2.5}
    axes.plot(place.at(curve.t), curve.values, label=d.label, **style)
    if curve.is_sampled and len(curve.t) <= 160:
        axes.plot(place.at(curve.t), curve.values, ".", color=d.colour, markersize=5)
    for points in curve.points:
        _draw_points(axes, place, points)


def _draw_line(axes: Axes, place: Abscissa, line: Line, colour: str) -> None:
    x = place.at(line.t)
    if line.kind == "reference":
        axes.plot(x, line.values, color="black", linestyle=(0, (1, 1.2)), linewidth=1.3,
                  label=f"reference: {line.name}", zorder=2.8)  # fmt: skip
    elif line.kind == "plan":
        axes.plot(x, line.values, color=colour, linestyle=(0, (4, 2)), linewidth=0.8, alpha=0.6,
                  label=line.name, zorder=2.1)  # fmt: skip
    else:
        bottom, top = axes.get_ylim()
        outside = int(((line.values < bottom) | (line.values > top)).sum())
        missing = int(np.isnan(line.values).sum())
        notes = [f"{n} {what}" for n, what in ((outside, "off scale"), (missing, "missing")) if n]
        said = f"{line.name} ({', '.join(notes)})" if notes else line.name
        axes.plot(x, line.values, linestyle="none", marker="o", markersize=2.6, color="0.35",
                  markerfacecolor="none", markeredgewidth=0.6, label=said, zorder=2.0)  # fmt: skip


def _draw_points(axes: Axes, place: Abscissa, points: Points) -> None:
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
        label = NO_LABEL
    for at, low, high in zip(x[~exact], points.lower[~exact], points.upper[~exact], strict=True):
        bottom, top = axes.get_ylim()
        ends = (low if np.isfinite(low) else bottom, high if np.isfinite(high) else top)
        axes.plot([at, at], ends, color="black", linewidth=3.0, alpha=0.55, label=label,
                  solid_capstyle="butt", zorder=2.1)  # fmt: skip
        for end in (low, high):
            if np.isfinite(end):
                axes.plot([at], [end], "_", color="black", markersize=9, zorder=3, clip_on=False)
        label = NO_LABEL


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
    axes: Axes, limits: Sequence[tuple[Drawn, Limit]], near: Sequence[list[np.ndarray]]
) -> None:
    """Draw limits once each: grey and hatched, or in the colours of runs where they differ."""
    by_run: dict[str, set[tuple[float, ...]]] = {}
    for d, limit in limits:
        by_run.setdefault(d.colour, set()).add(limit.summary)
    same = len({frozenset(found) for found in by_run.values()}) <= 1
    done: set[tuple[tuple[float, ...], str]] = set()
    for (d, limit), ends in zip(limits, near, strict=True):
        x, (bottom, top) = d.abscissa.at(d.curve.t), axes.get_ylim()
        if limit.is_soft:
            _draw_slack(axes, x, d.curve.values, limit)
        colour = _GREY if same else d.colour
        if (limit.summary, colour) in done:
            continue
        done.add((limit.summary, colour))
        hatched = same and d.abscissa.is_time
        for end, shown, sign in zip((limit.lower, limit.upper), ends, (-1, 1), strict=True):
            if shown.size:
                beyond = sign * 20.0 * (top - bottom)
                _draw_end(axes, x, end, beyond if hatched else 0.0, limit, colour)
            elif np.isfinite(end).any():
                _name_end(axes, end, sign)


def _draw_end(
    axes: Axes, x: np.ndarray, end: np.ndarray, beyond: float, limit: Limit, colour: str
) -> None:
    """Draw one end of a limit, and hatch what is beyond it, that far."""
    end = np.where(np.isfinite(end), end, np.nan)
    style = (0, (5, 2)) if limit.is_soft else "-"
    said = f"{limit.name} (soft)" if limit.is_soft else limit.name
    axes.plot(x, end, color=colour, linestyle=style, linewidth=0.9, label=said, zorder=2.0)
    if beyond:
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


def _name_end(axes: Axes, end: np.ndarray, sign: int) -> None:
    """Say in the legend where a limit is that is off the scale."""
    values = end[np.isfinite(end)]
    value = values.min() if sign > 0 else values.max()
    label = f"{'≤' if sign > 0 else '≥'} {value:.4g} (off scale)"
    axes.plot([], [], linestyle="none", label=label)
