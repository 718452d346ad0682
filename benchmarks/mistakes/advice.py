"""What somebody does who follows the first advice of a diagnosis, word by word."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from ocp import OCP, Box, FreeTime, Measurement, Parameter, ProblemError, Solver, UnsupportedProblem
from ocp import without_kinks as written_without_kinks
from ocp.internal import applied, scaled, walk
from solvers import Collocation, MultipleShooting
from solvers.internal import Cause, Finding

# Bounds given to what has none, the weight of a term that was left out, a distance from a
# singular point, the width of a smooth kink.
_BOUND, _WEIGHT, _AWAY, _WIDTH = 10.0, 0.1, 0.05, 0.05
_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Followed:
    """A problem after somebody did what the first finding says, and the solver to try next."""

    ocp: OCP
    solver: Solver = field(default_factory=lambda: MultipleShooting(50))


def followed(ocp: OCP, finding: Finding) -> Followed:
    """Return the problem with the advice of a finding followed."""
    names = finding.where
    match finding.cause:
        case Cause.LINEAR_COST | Cause.FREE_CONTROL:
            return Followed(replace(ocp, control_bounds=_bounded(ocp.control_bounds)))
        case Cause.UNBOUNDED:
            boxes = _bounded(ocp.control_bounds), _bounded(ocp.state_bounds)
            unknowns = tuple(
                replace(e, lower=np.maximum(e.lower, -_BOUND), upper=np.minimum(e.upper, _BOUND))
                for e in ocp.unknowns
            )
            bounded = replace(ocp, unknowns=unknowns, control_bounds=boxes[0])
            return Followed(replace(bounded, state_bounds=boxes[1]))
        case Cause.WRONG_SIGN:
            return Followed(_with_signs_changed(ocp, names))
        case Cause.NO_GOAL:
            off = ocp.model.x - (ocp.start() + 0.5)
            return Followed(replace(ocp, terminal_cost=ca.SX(ocp.terminal_cost) + ca.sumsqr(off)))
        case Cause.VANISHING_TIME:
            return Followed(replace(ocp, horizon=FreeTime(ocp.duration, lower=ocp.duration / 2)))
        case Cause.ENDLESS_TIME:
            return Followed(replace(ocp, horizon=FreeTime(ocp.duration, upper=2 * ocp.duration)))
        case Cause.UNUSED:
            return Followed(_priced(ocp, names))
        case Cause.KINK:
            return Followed(_smooth(ocp))
        case Cause.BAD_SCALING:
            return Followed(scaled(ocp) or ocp)
        case Cause.NO_INFLUENCE:
            forgotten = ca.vertcat(ca.SX.zeros(ocp.model.nx - 1), ca.sum1(_symbols(ocp, names)))
            return Followed(replace(ocp, model=replace(ocp.model, f=ocp.model.f + forgotten)))
        case Cause.GUESS_OUTSIDE:
            return Followed(replace(ocp, guess=None))
        case Cause.NOT_FINITE:
            return Followed(_kept_away(ocp, names))
        case Cause.DEGREES:
            return Followed(_in_radians(ocp, names))
        case Cause.UNIDENTIFIABLE:
            return Followed(_with_a_number(ocp, names))
        case Cause.OUTLIER:
            return Followed(_without_the_value(ocp, finding))
        case Cause.CHEAP_SOFT:
            hard = [replace(c, soft=None) if c.name in names else c for c in ocp.constraints]
            return Followed(replace(ocp, constraints=tuple(hard)))
        case Cause.TIME_KIND:
            return Followed(_with_the_other_time(ocp))
        case Cause.COARSE_GRID:
            return Followed(ocp, Collocation(30))
        case _:
            return Followed(_without_the_first(ocp, names))


def _bounded(box: Box) -> Box:
    """Return the box, with bounds where there are none."""
    return Box(np.maximum(box.lower, -_BOUND), np.minimum(box.upper, _BOUND))


def _changed(
    box: Box, all_names: Sequence[str], names: Sequence[str], lower: float, upper: float
) -> Box:
    """Return the box with other bounds for some names."""
    meant = np.isin(all_names, names)
    return Box(np.where(meant, lower, box.lower), np.where(meant, upper, box.upper))


def _symbols(ocp: OCP, names: Sequence[str]) -> ca.SX:
    """Return the states and controls of these names."""
    m = ocp.model
    every = zip((*m.x_names, *m.u_names), ca.vertsplit(ca.vertcat(m.x, m.u)), strict=True)
    return ca.vertcat(ca.SX(0, 1), *[symbol for name, symbol in every if name in names])


def _with_signs_changed(ocp: OCP, names: Sequence[str]) -> OCP:
    """Turn every term of the named around: L becomes 2 L(at zero) - L."""
    v = _symbols(ocp, names)

    def turned(cost: ca.SX | float) -> ca.SX:
        return 2 * ca.substitute(ca.SX(cost), v, ca.SX.zeros(v.shape)) - cost

    end = turned(ocp.terminal_cost) if "terminal" in _bending(ocp, v) else ocp.terminal_cost
    cost = turned(ocp.running_cost) if "running" in _bending(ocp, v) else ocp.running_cost
    return replace(ocp, running_cost=cost, terminal_cost=end)


def _bending(ocp: OCP, v: ca.SX) -> list[str]:
    """Return which costs have a negative second derivative in v at the start."""
    m, found = ocp.model, []
    for what, cost in (("running", ocp.running_cost), ("terminal", ocp.terminal_cost)):
        second = ca.diag(ca.hessian(ca.SX(cost), v)[0])
        bends = ca.Function("bends", [m.x, m.u, m.t, ocp.p], [second])
        p = ocp.parameter_values().at(0.0)[0]
        if (np.array(bends(ocp.start(), np.zeros(m.nu), 0.0, p)) < 0.0).any():
            found.append(what)
    return found


def _priced(ocp: OCP, names: Sequence[str]) -> OCP:
    """Put what nothing contains into the cost."""
    entries = [entry.symbol for entry in ocp.parameters if entry.name in names]
    missing = ca.vertcat(*entries, _symbols(ocp, names))
    m = ocp.model
    term = ca.sumsqr(missing) if not entries else ca.sumsqr(m.u) * ca.sumsqr(missing)
    return replace(ocp, running_cost=ca.SX(ocp.running_cost) + _WEIGHT * term)


def _smooth(ocp: OCP) -> OCP:
    """Take slack controls where they serve, else write what is smooth for every kink and jump."""
    try:
        return written_without_kinks(ocp)
    except (UnsupportedProblem, ProblemError):
        pass
    m = ocp.model
    symbols = ca.vertcat(m.x, m.u, m.t, ocp.p)

    def smooth(expression: ca.SX | float) -> ca.SX:
        return walk(ca.SX(expression), symbols, lambda leaf: leaf, _smooth_node)

    f = ca.vertcat(*[smooth(rate) for rate in ca.vertsplit(m.f)])
    cost, end = smooth(ocp.running_cost), smooth(ocp.terminal_cost)
    return replace(ocp, model=replace(m, f=f), running_cost=cost, terminal_cost=end)


def _smooth_node(_: int, operation: int, arguments: list[ca.SX]) -> ca.SX:
    """Return one operation, smooth within a width."""
    first, second = arguments[0], arguments[-1]
    difference = first - second
    match operation:
        case ca.OP_FABS:
            return ca.sqrt(first**2 + _WIDTH**2)
        case ca.OP_FMAX | ca.OP_FMIN:
            sign = 1.0 if operation == ca.OP_FMAX else -1.0
            return (first + second + sign * ca.sqrt(difference**2 + _WIDTH**2)) / 2
        case ca.OP_LT | ca.OP_LE:
            return (1 - ca.tanh(difference / _WIDTH)) / 2
    return applied(operation, arguments)


def _kept_away(ocp: OCP, names: Sequence[str]) -> OCP:
    """Start elsewhere, bound the named states away from zero, or stop before the time is up."""
    if "t" in names:
        return replace(ocp, horizon=(1.0 - _AWAY) * ocp.duration)
    named = np.isin(ocp.model.x_names, names)
    if any(entry.name in names for entry in ocp.unknowns):
        away = tuple(
            replace(e, guess=np.maximum(e.guess, 2 * _AWAY), lower=np.maximum(e.lower, _AWAY))
            if e.name in names
            else e
            for e in ocp.unknowns
        )
        return replace(ocp, unknowns=away)
    if not named.any():
        moved = [
            entry if isinstance(entry, Parameter) else replace(entry, samples=entry.value + 1.0)
            for entry in ocp.parameters
        ]
        return replace(ocp, parameters=tuple(moved))
    box = ocp.state_bounds
    lower = np.where(named, np.maximum(box.lower, _AWAY), box.lower)
    start = np.where(named, np.maximum(ocp.start(), 2 * _AWAY), ocp.start())
    return replace(ocp, state_bounds=Box(lower, box.upper), x0=start)


def _with_a_number(ocp: OCP, names: Sequence[str]) -> OCP:
    """Fix the first named of the unknown constants at its guess."""
    first = next(entry for entry in ocp.unknowns if entry.name in names)
    return replace(
        ocp,
        unknowns=tuple(entry for entry in ocp.unknowns if entry is not first),
        parameters=(*ocp.parameters, Parameter(first.name, first.symbol, first.value)),
    )


def _without_the_value(ocp: OCP, finding: Finding) -> OCP:
    """Write NaN for the value that is named."""

    def mended(measured: Measurement) -> Measurement:
        values = np.asarray(measured.values)
        wrong = values == finding.evidence
        is_it = measured.name in finding.where
        return replace(measured, values=np.where(wrong, np.nan, values)) if is_it else measured

    return replace(ocp, data=tuple(mended(measured) for measured in ocp.data))


def _in_radians(ocp: OCP, names: Sequence[str]) -> OCP:
    """Write what is larger than a turn in radians; else the cost means degrees."""
    named = np.isin(ocp.model.x_names, names)

    def radians(values: np.ndarray) -> np.ndarray:
        values = np.asarray(values, dtype=float)
        large = np.isfinite(values) & (np.abs(values) > _TURN)
        return np.where(large, np.deg2rad(np.where(large, values, 0.0)), values)

    start = np.where(named, radians(ocp.start()), ocp.start())
    box = ocp.state_bounds
    bounds = Box(
        np.where(named, radians(np.asarray(box.lower)), box.lower),
        np.where(named, radians(np.asarray(box.upper)), box.upper),
    )
    constraints = tuple(
        replace(c, lower=radians(np.asarray(c.lower)), upper=radians(np.asarray(c.upper)))
        for c in ocp.constraints
    )
    angles = _symbols(ocp, names)
    degrees = ca.substitute(ca.SX(ocp.terminal_cost), angles, angles * (360.0 / _TURN))
    unknowns = tuple(
        replace(
            entry, **{part: radians(getattr(entry, part)) for part in ("guess", "lower", "upper")}
        )
        if entry.name in names
        else entry
        for entry in ocp.unknowns
    )
    return replace(
        ocp,
        x0=start,
        state_bounds=bounds,
        constraints=constraints,
        unknowns=unknowns,
        terminal_cost=degrees,
        guess=None,
    )


def _with_the_other_time(ocp: OCP) -> OCP:
    """Leave dt out where there is one, else give it."""
    m, dt = ocp.model, ocp.model.dt
    if dt is not None:
        return replace(ocp, model=replace(m, dt=None), horizon=ocp.duration)
    return replace(ocp, model=replace(m, dt=0.1), horizon=round(ocp.duration / 0.1))


def _without_the_first(ocp: OCP, names: Sequence[str]) -> OCP:
    """Leave out the first constraint that is named, or the bounds of the first that is.

    Or a delay, peak or rate of that name.
    """
    named = [c for c in ocp.constraints if c.name in names]
    if named:
        return replace(ocp, constraints=tuple(c for c in ocp.constraints if c is not named[0]))
    peaks = tuple(peak for peak in ocp.peaks if peak.name not in names)
    delays = tuple(delay for delay in ocp.delays if str(delay.control) not in names)
    if len(peaks) < len(ocp.peaks) or len(delays) < len(ocp.delays):
        return replace(ocp, peaks=peaks, delays=delays)
    free, m = (-np.inf, np.inf), ocp.model
    first = [name for name in names if name in (*m.x_names, *m.u_names)][:1]
    return replace(
        ocp,
        state_bounds=_changed(ocp.state_bounds, m.x_names, first, *free),
        control_bounds=_changed(ocp.control_bounds, m.u_names, first, *free),
    )
