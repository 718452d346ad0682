r"""Nominal sizes of states, controls, cost and rows, in which a problem is well scaled.

They are found in logarithms by least squares, so that they follow every change of units. With T
the horizon, and derivatives taken near start and guess, each of these asks two sizes to agree:

.. math::

    T \, |f_{i,x_j}| \, s_j = s_i, \qquad T \, |f_{i,u_j}| \, s_{u_j} = s_i, \qquad
    T \, |L_{x_j}| \, s_j = s_J, \qquad T \, |L_{x_j x_j}| \, s_j^2 = s_J, \qquad
    |c_{x_j}| \, s_j = |c - b|

and start, bounds, guess, T f at the start, and the cost itself are sizes by their numbers.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp.problem.constraint import Constraint
from ocp.problem.constraint_rows import ConstraintRows
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Signal
from ocp.problem.size_equations import SizeEquation, solved

# How much each kind of knowledge counts: what is declared, bounds, start and guess, dynamics, the
# rate at the start (which fast dynamics keep up for much less than T), cost, rows.
_DECLARED = 100.0
_BOUND, _GIVEN, _DYNAMICS, _RATE, _COST, _ROW = 2.0, 1.0, 1.0, 0.2, 0.3, 0.5
# What is left of terms that cancel, relative to them, is rounding.
_ROUNDING = 1e-9
# What changes by more than this part of itself with a tick of the clock, a part of the horizon, is
# decided by rounding.
_UNSTEADY, _TICK = 0.5, 1e-12
# Beside a point, at so many others, a called function has its usual size, of which this is noise.
_BESIDE, _NOISE = 4, 1e-13
# Rounds of least squares: the later ones take derivatives a size away from the start.
_ROUNDS = 3
# A row has at least this part of its distance from the bounds as its size.
_OF_DISTANCE = 0.1
# Where along the guess derivatives are taken, beside the instants at which signals are largest.
_FRACTIONS = np.array([0.0, 0.5, 1.0])


# Where the horizon lies within these, seconds are a good unit of time [s].
_ORDINARY = 1 / 16, 16.0


def time_unit(ocp: OCP) -> float:
    """Return in what unit times of the order of the horizon are numbers near 1 [s]."""
    low, high = _ORDINARY
    if ocp.model.is_discrete or low <= ocp.duration <= high:
        return 1.0
    return float(2.0 ** np.round(np.log2(ocp.duration)))


@dataclass(frozen=True, eq=False)
class Sizes:
    """What is large or small for a problem, in its own units; all positive.

    Attributes:
        x: of the states (nx,).
        u: of the controls (nu,).
        cost: of running cost over the horizon plus terminal cost.
        rows: of the rows of each constraint, by name.
    """

    x: np.ndarray
    u: np.ndarray
    cost: float
    rows: dict[str, np.ndarray]

    def of_rows(self, rows: ConstraintRows) -> np.ndarray:
        """Return the sizes of rows of constraints, (m,)."""
        names = dict.fromkeys(row.name for row in rows.rows)
        return np.concatenate([[], *[self.rows[name] for name in names]])


class _Point(NamedTuple):
    """Where derivatives are taken: state, control, time, parameters."""

    x: np.ndarray
    u: np.ndarray
    t: float
    p: np.ndarray


def nominal_sizes(ocp: OCP) -> Sizes:
    """Return the nominal sizes of a problem; what the user declared as nominal stays."""
    functions, points = _Functions.of(ocp), _points(ocp)
    m = ocp.model
    if m.x_nominal is None or m.u_nominal is None:
        log_sizes = _estimated(ocp, functions, points)
    else:
        log_sizes = _with_cost(ocp, functions, points, np.append(m.x_nominal, m.u_nominal))
    x, u = np.exp(log_sizes[: m.nx]), np.exp(log_sizes[m.nx : -1])
    if m.x_nominal is not None:
        x = np.asarray(m.x_nominal, dtype=float)
    if m.u_nominal is not None:
        u = np.asarray(m.u_nominal, dtype=float)
    last = [*points, *_displaced(ocp, points, np.concatenate([x, u, [1.0]]))]
    rows = {c.name: functions.row_sizes(c, last, np.concatenate([x, u])) for c in ocp.constraints}
    return Sizes(x, u, float(np.exp(log_sizes[-1])), rows)


def _estimated(ocp: OCP, functions: "_Functions", points: list[_Point]) -> np.ndarray:
    """Return the logarithms of all sizes (nx + nu + 1,), the cost's last."""
    size = ocp.model.nx + ocp.model.nu + 1
    known = [*_given(ocp), *functions.rate_sizes(points[0])]
    # Before anything is known of sizes no point lies a size away.
    at_points = [e for p in points for e in (*functions.equations(p), *functions.of_costs(p))]
    log_sizes = solved([*known, *at_points], size)
    for _ in range(_ROUNDS):
        equations = [*known, *at_points]
        for point, beside in zip(points, _displaced(ocp, points, np.exp(log_sizes)), strict=True):
            equations += [*functions.equations(beside), *functions.of_curvature(point, beside)]
        log_sizes = solved(equations, size)
    return log_sizes


def _with_cost(
    ocp: OCP, functions: "_Functions", points: list[_Point], declared: np.ndarray
) -> np.ndarray:
    """Return the same where those of all states and controls are declared (nx + nu,)."""
    log_sizes, cost = np.append(np.log(declared), 0.0), len(declared)
    beside = _displaced(ocp, points, np.append(declared, 1.0))
    equations = [e for point in points for e in functions.of_costs(point)]
    for pair in zip(points, beside, strict=True):
        equations += functions.of_curvature(*pair)
    values = [
        e.value - sum(log_sizes[i] for i in e.plus if i != cost) + log_sizes[list(e.minus)].sum()
        for e in equations
    ]
    log_sizes[cost] = np.mean(values) if values else 0.0
    return log_sizes


@dataclass(frozen=True, eq=False)
class _Functions:
    """Values and first derivatives of everything that relates sizes.

    Attributes:
        nx: states.
        horizon: T, or the number of steps.
        dynamics: (x, u, t, p) -> rate f, or the change of the state in a step; its Jacobian.
        costs: -> running cost and its gradients in (x, u) and p; the same of the terminal cost.
        constraints: by name: values and Jacobian in (x, u).
        is_timed: whether any of them depends on the clock.
        calls: whether any of them calls a function, such as a table, whose zeros have rounding.
    """

    nx: int
    horizon: float
    dynamics: ca.Function
    costs: ca.Function
    constraints: dict[str, tuple[Constraint, ca.Function]]
    is_timed: bool
    calls: bool

    @classmethod
    def of(cls, ocp: OCP) -> "_Functions":
        m, p = ocp.model, ocp.p
        given, w = [m.x, m.u, m.t, p], ca.vertcat(m.x, m.u)
        rate = m.f - m.x if m.is_discrete else m.f
        outputs = []
        for cost in (ca.SX(ocp.running_cost), ca.SX(ocp.terminal_cost)):
            outputs += [cost, ca.gradient(cost, w), ca.gradient(cost, p)]
        horizon = float(ocp.steps or ocp.duration)

        def row(c: Constraint) -> ca.Function:
            value = horizon * c.expression if c.at == "integral" else c.expression
            return ca.Function("c", given, [value, ca.jacobian(value, w)])

        constraints = {c.name: (c, row(c)) for c in ocp.constraints}
        written = [
            rate,
            ocp.running_cost,
            ocp.terminal_cost,
            *(c.expression for c in ocp.constraints),
        ]
        return cls(
            nx=m.nx,
            horizon=horizon,
            dynamics=ca.Function("f", given, [rate, ca.jacobian(rate, w)]),
            costs=ca.Function("costs", given, [ca.densify(o) for o in outputs]),
            constraints=constraints,
            is_timed=ca.depends_on(ca.veccat(*written), m.t),
            calls=bool(ocp.functions.called),
        )

    def _values(self, function: ca.Function, point: _Point) -> list[np.ndarray]:
        """Return the outputs at a point, 0 where rounding of the clock decides them.

        A sine that is zero at an instant but for rounding says nothing of sizes there.
        """
        if self.calls:
            return self._without_rounding(function, point)
        if not self.is_timed:
            return [np.array(here) for here in function(*point)]
        later = point._replace(t=point.t + _TICK * self.horizon)
        each = zip(function(*point), function(*later), strict=True)
        both = ((np.array(here), np.array(there)) for here, there in each)
        with np.errstate(invalid="ignore"):  # what is not finite stays so, and is left out later
            return [
                np.where(np.abs(there - here) > _UNSTEADY * np.abs(here), 0.0, here)
                for here, there in both
            ]

    def _without_rounding(self, function: ca.Function, point: _Point) -> list[np.ndarray]:
        """Return the outputs at a point, 0 where they are rounding of what they are beside it."""
        rng, found = np.random.default_rng(0), [np.array(here) for here in function(*point)]
        largest = [np.zeros(here.shape) for here in found]
        for _ in range(_BESIDE):
            x, u = (w + rng.uniform(-1, 1, len(w)) * (1 + np.abs(w)) for w in (point.x, point.u))
            values = function(*point._replace(x=x, u=u))
            largest = [
                np.fmax(a, np.abs(np.array(b))) for a, b in zip(largest, values, strict=True)
            ]
        each = zip(found, largest, strict=True)
        return [np.where(np.abs(a) <= _NOISE * most, 0.0, a) for a, most in each]

    def equations(self, point: _Point) -> Iterator[SizeEquation]:
        """Yield what dynamics and constraints at a point say of the sizes."""
        yield from self._of_dynamics(point)
        for c, function in self.constraints.values():
            value, jacobian = self._values(function, point)
            terms = np.abs(jacobian) @ np.abs(np.concatenate([point.x, point.u]))
            offset = _offset(c, value.ravel(), terms)
            for i, j in zip(*np.nonzero(_usable(jacobian)), strict=True):
                if offset[i] > 0.0:
                    size = float(np.log(offset[i]) - np.log(abs(jacobian[i, j])))
                    is_limit = bool(np.ravel(c.lower)[i] != np.ravel(c.upper)[i])
                    yield SizeEquation(_ROW, (int(j),), (), size, is_limit)

    def rate_sizes(self, point: _Point) -> Iterator[SizeEquation]:
        """Yield what the rate at a point says of the sizes by itself."""
        rate, jacobian = self._values(self.dynamics, point)
        rate = self.horizon * rate.ravel()
        terms = self.horizon * np.abs(jacobian) @ np.abs(np.concatenate([point.x, point.u]))
        for i in np.flatnonzero(_usable(rate) & (np.abs(rate) > _ROUNDING * terms)).tolist():
            yield SizeEquation(_RATE, (i,), (), float(np.log(abs(rate[i]))))

    def _of_dynamics(self, point: _Point) -> Iterator[SizeEquation]:
        jacobian = self.horizon * self._values(self.dynamics, point)[1]
        for i, j in zip(*np.nonzero(_usable(jacobian)), strict=True):
            if i != j:
                gain = float(np.log(abs(jacobian[i, j])))
                yield SizeEquation(_DYNAMICS, (int(i),), (int(j),), gain)

    def of_curvature(self, point: _Point, beside: _Point) -> Iterator[SizeEquation]:
        """Yield what the change of the cost's slopes between two points says of the sizes."""
        here, there = ([np.array(v).ravel() for v in self.costs(*at)] for at in (point, beside))
        moved = np.concatenate([beside.x - point.x, beside.u - point.u])
        for share, i in ((self.horizon, 1), (1.0, 4)):
            change = there[i] - here[i]
            change[np.abs(change) <= _ROUNDING * np.abs(here[i])] = 0.0
            for j in np.flatnonzero(_usable(change) & _usable(moved)).tolist():
                curvature = share * abs(change[j] / moved[j])
                yield SizeEquation(_COST, (len(moved),), (j, j), float(np.log(curvature)))

    def of_costs(self, point: _Point) -> Iterator[SizeEquation]:
        """Yield what values and slopes of the cost at a point say of the sizes."""
        values = [v.ravel() for v in self._values(self.costs, point)]
        cost = len(values[1])  # its place among the sizes
        for share, (value, slope, by_p) in ((self.horizon, values[:3]), (1.0, values[3:])):
            own = share * np.concatenate([value, by_p * point.p])
            for size in own[_usable(own)]:
                yield SizeEquation(_COST, (cost,), (), float(np.log(abs(size))))
            for j in np.flatnonzero(_usable(slope)).tolist():
                yield SizeEquation(_COST, (cost,), (j,), float(np.log(share * abs(slope[j]))))

    def row_sizes(self, c: Constraint, points: Iterable[_Point], w: np.ndarray) -> np.ndarray:
        """Return how much each row of a constraint changes along the sizes of x and u.

        One that hardly changes near the points is measured by its distance from the bounds.
        """
        if c.nominal is not None:
            return np.broadcast_to(np.asarray(c.nominal, dtype=float), c.size).copy()
        changes, distances = [], []
        for point in points:
            value, jacobian = (np.array(v) for v in self.constraints[c.name][1](*point))
            moved = np.abs(jacobian) * w
            changes.append(np.where(np.isfinite(moved), moved, 0.0).max(axis=1))
            distances.append(_distance(c, value.ravel()))
        sizes = np.maximum(np.max(changes, axis=0), _OF_DISTANCE * np.min(distances, axis=0))
        return np.where(sizes > 0.0, sizes, 1.0)


def _points(ocp: OCP) -> list[_Point]:
    """Return the start, and points along the guess."""
    m, fractions = ocp.model, np.append(_FRACTIONS, _peaks(ocp))
    u0 = ocp.control_bounds.clip(np.zeros(m.nu))
    x, u = (np.tile(each, (len(fractions), 1)) for each in (ocp.start(), u0))
    if ocp.guess is not None:
        guess_x = ocp.guess.sample("x", fractions, m.nx)
        guess_u = ocp.guess.sample("u", fractions, m.nu)
        x, u = (x if guess_x is None else guess_x), (u if guess_u is None else guess_u)
    p = ocp.parameter_values().at(fractions)
    # A sine that is zero at an instant but for rounding says nothing of sizes there.
    p[np.abs(p) <= _ROUNDING * np.abs(p).max(axis=0, initial=0.0)] = 0.0
    return [_Point(*each) for each in zip(x, u, ocp.duration * fractions, p, strict=True)]


def _peaks(ocp: OCP) -> np.ndarray:
    """Return the fractions of the horizon at which the samples of signals are largest."""
    found = []
    for entry in ocp.parameters:
        if isinstance(entry, Signal):
            row = int(np.abs(entry.value).max(axis=1).argmax())
            found.append(entry.knots[row])
    return np.setdiff1d(found, _FRACTIONS)


def _displaced(ocp: OCP, points: list[_Point], sizes: np.ndarray) -> list[_Point]:
    """Return points a size away in every state and control, within the bounds."""
    nx, rng = ocp.model.nx, np.random.default_rng(0)
    found = []
    for point in points:
        sign = rng.choice([-1.0, 1.0], size=len(sizes) - 1)
        x = ocp.state_bounds.clip(point.x + sign[:nx] * sizes[:nx])
        u = ocp.control_bounds.clip(point.u + sign[nx:] * sizes[nx:-1])
        found.append(point._replace(x=x, u=u))
    return found


def _given(ocp: OCP) -> Iterator[SizeEquation]:
    """Yield what the user, start, guess and bounds say of the sizes by themselves."""
    m = ocp.model
    for declared, first in ((m.x_nominal, 0), (m.u_nominal, m.nx)):
        for j, size in enumerate([] if declared is None else np.ravel(declared)):
            yield SizeEquation(_DECLARED, (first + j,), (), float(np.log(size)))
    rows = [(_GIVEN, 0, ocp.start()[None, :])]
    if ocp.guess is not None:
        for part, first, width in (("x", 0, m.nx), ("u", m.nx, m.nu)):
            samples = ocp.guess.sample(part, _FRACTIONS, width)
            if samples is not None:
                rows.append((_GIVEN, first, samples))
    for box, first in ((ocp.state_bounds, 0), (ocp.control_bounds, m.nx)):
        bounds = np.vstack([np.asarray(box.lower, float), np.asarray(box.upper, float)])
        rows.append((_BOUND, first, np.where(np.isfinite(bounds), bounds, 0.0)))
    for weight, first, samples in rows:
        largest = np.abs(samples).max(axis=0)
        for j in np.flatnonzero(_usable(largest)).tolist():
            size = float(np.log(largest[j]))
            yield SizeEquation(weight, (first + j,), (), size, weight == _BOUND)


def _distance(c: Constraint, value: np.ndarray) -> np.ndarray:
    """Return how far the rows of a constraint are from the nearest bound; 0 where unknown."""
    sides = np.vstack([np.asarray(c.lower, float), np.asarray(c.upper, float)]) - value
    nearest = np.abs(sides).min(axis=0)
    return np.where(np.isfinite(nearest), nearest, 0.0)


def _offset(c: Constraint, value: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """Return how far the rows of a constraint are from their bounds; 0 where that says nothing.

    Args:
        c: the constraint.
        value: of its rows.
        terms: magnitude of what they are sums of: what is left of terms that cancel is rounding.
    """
    sides = np.vstack([np.asarray(c.lower, float), np.asarray(c.upper, float)]) - value
    distance = np.where(np.isfinite(sides), np.abs(sides), 0.0)
    distance[distance <= _ROUNDING * np.maximum(np.abs(value), terms)] = 0.0
    largest = distance.max(axis=0)
    return np.where(_usable(largest), largest, 0.0)


def _usable(values: np.ndarray) -> np.ndarray:
    return np.isfinite(values) & (values != 0.0)
