"""The curves of a solution: every quantity with its limits, references and points."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ocp.plotting.curve import Curve, Limit, Line, Points, Role
from ocp.plotting.plottable import PlottableSolution
from ocp.plotting.references import names_of, references_of
from ocp.plotting.single_variable import SingleVariable, single_variables
from ocp.plotting.trajectory import Trajectory
from ocp.problem.constraint import Box, Constraint
from ocp.problem.measurement import Measurement
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Signal


def curves_of(solution: PlottableSolution) -> tuple[Curve, ...]:
    """Return all curves of a solution, in the order in which they are drawn.

    A path constraint, a terminal one, one at instants and a measurement that are of a single
    variable belong to the curve of that variable; the others have a curve of their own. So it is
    with a signal that the running cost compares with a variable.
    """
    way = Trajectory.of(solution)
    additions = _Additions(way)
    others = [*additions.paths(), *additions.at_instants(), *additions.measured()]
    signals = list(additions.signals())
    additions.ends()
    rates = _rates(way, solution.data.values.named("last_input"))
    invariants = _own(way, "invariant", way.ocp.invariants)
    costates = zip(way.ocp.model.x_names, solution.costate_at(way.t).T, strict=True)
    return (
        *_variables(way, additions),
        *rates,
        *signals,
        *others,
        *invariants,
        *(Curve(f"∂J/∂({name})", "", "costate", way.t, row) for name, row in costates),
    )


def curves_along(way: Trajectory) -> tuple[Curve, ...]:
    """Return the curves of what acted on a plant: what is said of a whole trajectory is left out.

    Args:
        way: with inputs that are held from one instant to the next.
    """
    additions = _Additions(way)
    others, signals = list(additions.paths()), list(additions.signals())
    rates = _rates(way, None, is_held=True)
    invariants = _own(way, "invariant", way.ocp.invariants)
    return (*_variables(way, additions), *rates, *signals, *others, *invariants)


def _variables(way: Trajectory, additions: "_Additions") -> Iterator[Curve]:
    """Yield states, algebraic variables and controls."""
    m, k = way.ocp.model, 0
    kinds: list[tuple[Role, tuple[str, ...], tuple[str, ...], np.ndarray, Box | None]] = [
        ("state", m.x_names, m.x_units, way.x, way.ocp.state_bounds),
        ("control", m.u_names, m.u_units, way.u, way.ocp.control_bounds),
        ("algebraic", m.z_names, m.z_units, way.z, None),
    ]
    found: dict[str, list[Curve]] = {}
    for role, names, units, values, box in kinds:
        for i, name in enumerate(names):
            own = () if box is None else _limit("bounds", _row(box, i), len(way.t))
            found.setdefault(role, []).append(
                Curve(
                    name,
                    units[i] if units else "",
                    role,
                    way.t,
                    values[:, i],
                    (*own, *additions.limits.get(k, ())),
                    tuple(additions.lines.get(k, ())),
                    tuple(additions.points.get(k, ())),
                    is_sampled=m.is_discrete and role == "state",
                )
            )
            k += 1
    for role in ("state", "algebraic", "control"):
        yield from found.get(role, [])


def _rates(way: Trajectory, last: np.ndarray | None, *, is_held: bool = False) -> Iterator[Curve]:
    """Yield the rates of the controls that have bounds or prices of them, as steps.

    Args:
        way: along which.
        last: the controls with a rate just before the start; None: what they are at first.
        is_held: whether a control that jumps counts as if it moved in the interval behind.
    """
    ocp = way.ocp
    m, rates, t = ocp.model, ocp.control_rates, way.t
    lengths = np.ones(len(t) // 2) if m.is_discrete else np.diff(t)[::2]
    for k, i in enumerate(rates.index):
        u, unit = way.u[:, i], m.u_units[i] if m.u_units else ""
        changes = np.diff(u)[::2]
        if m.is_discrete or is_held:
            changes = np.diff(u[::2], prepend=u[0] if last is None else last[k])
        unit = f"{unit}/{'step' if m.is_discrete else 's'}" if unit else ""
        values = np.repeat(changes / lengths, 2)
        limit = _limit("bounds", _row(rates.box, k), len(t))
        yield Curve(rates.names[k], unit, "rate", t, values, limit)


def _own(way: Trajectory, role: Role, constraints: Sequence[Constraint]) -> Iterator[Curve]:
    """Yield a curve for every row of some constraints."""
    for c in constraints:
        values = way.along(c.expression)
        for i in range(c.size):
            limit = _limit(c.name, _row(c.box, i), len(way.t), c.soft is not None)
            yield Curve(_numbered(c, i), "", role, way.t, values[:, i], limit)


@dataclass(eq=False)
class _Additions:
    """What belongs to a variable beside its values; by its place among x, u and z."""

    way: Trajectory
    limits: dict[int, list[Limit]] = field(default_factory=dict)
    lines: dict[int, list[Line]] = field(default_factory=dict)
    points: dict[int, list[Points]] = field(default_factory=dict)

    @property
    def ocp(self) -> OCP:
        """The problem."""
        return self.way.ocp

    def paths(self) -> Iterator[Curve]:
        """Yield the path constraints that are of no single variable."""
        for c in self.ocp.at("path"):
            curves = list(_own(self.way, "constraint", [c]))
            for curve, single in zip(curves, single_variables(self.ocp, c.expression), strict=True):
                if single is None:
                    yield curve
                else:
                    self._limit(single, curve.limits, curve.values)

    def _limit(self, single: SingleVariable, limits: tuple[Limit, ...], c: np.ndarray) -> None:
        """Keep limits of c = slope v + rest as limits of v = (c - rest) / slope."""
        v = self.way.variables[:, single.place]
        for limit in limits:
            ends = [v + (end - c) / single.slope for end in (limit.lower, limit.upper)]
            lower, upper = ends if single.slope > 0 else ends[::-1]
            moved = replace(limit, lower=lower, upper=upper)
            self.limits.setdefault(single.place, []).append(moved)

    def signals(self) -> Iterator[Curve]:
        """Yield the signals that are no reference of a variable."""
        way, references, first = self.way, references_of(self.way), 0
        for place, (name, owner) in references.items():
            line = Line(name, way.t, way.p[:, place])
            self.lines.setdefault(owner, []).append(line)
        for entry in self.ocp.entries:
            size = entry.symbol.numel()
            if isinstance(entry, Signal):
                for i, name in enumerate(names_of(entry)):
                    if first + i not in references:
                        yield Curve(name, "", "signal", way.t, way.p[:, first + i])
            first += size

    def at_instants(self) -> Iterator[Curve]:
        """Yield the constraints at instants that are of no single variable."""
        for c in self.ocp.at("instants"):
            low, high = (np.tile(end, (len(c.instants), 1)) for end in (c.lower, c.upper))
            yield from self._points(c, c.instants, low, high)

    def ends(self) -> None:
        """Keep the terminal constraints that are of a single variable."""
        last = self.way.t[-1:] - self.way.t[0]
        for c in self.ocp.at("terminal"):
            low, high = (np.asarray(end)[None, :] for end in (c.lower, c.upper))
            list(self._points(c, last, low, high))  # the others have nothing to be drawn along

    def measured(self) -> Iterator[Curve]:
        """Yield what was measured of no single variable."""
        for m in self.ocp.data:
            y, sigma = np.asarray(m.values), np.asarray(m.sigma)
            yield from self._points(m, np.asarray(m.times), y - sigma, y + sigma)

    def _points(
        self, given: Constraint | Measurement, times: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> Iterator[Curve]:
        """Keep points of a single variable; yield a curve for the others."""
        way, rows = self.way, self.way.along(given.expression)
        singles = single_variables(self.ocp, given.expression)
        is_measured = isinstance(given, Measurement)
        for i, single in enumerate(singles):
            when = way.t[0] + times
            ends = [low[:, i], high[:, i]]
            if single is not None:
                rest = rows[:, i] - single.slope * way.variables[:, single.place]
                ends = [(e - np.interp(when, way.t, rest)) / single.slope for e in ends]
                ends = ends if single.slope > 0 else ends[::-1]
            middle = np.where(np.isfinite(ends[0]), ends[0], ends[1])
            both = np.isfinite(ends[0]) & np.isfinite(ends[1])
            middle = np.where(both, (ends[0] + ends[1]) / 2, middle)
            points = Points(given.name, is_measured, when, middle, *ends)
            if single is not None:
                self.points.setdefault(single.place, []).append(points)
            else:
                role: Role = "data" if is_measured else "constraint"
                yield Curve(_numbered(given, i), "", role, way.t, rows[:, i], points=(points,))


def _numbered(given: Constraint | Measurement, i: int) -> str:
    return f"{given.name} {i}" if given.size > 1 else given.name


def _row(box: Box, i: int) -> tuple[float, float]:
    return float(np.asarray(box.lower)[i]), float(np.asarray(box.upper)[i])


def _limit(
    name: str, ends: tuple[float, float], count: int, is_soft: bool = False
) -> tuple[Limit, ...]:
    """Return a constant limit; none where both ends are infinite."""
    limit = Limit(name, np.full(count, ends[0]), np.full(count, ends[1]), is_soft)
    return (limit,) if limit.is_there else ()
