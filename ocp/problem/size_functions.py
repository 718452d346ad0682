"""What dynamics, costs and constraints at a point say of the sizes."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp.problem.constraint import Constraint
from ocp.problem.ocp import OCP
from ocp.problem.size_equations import SizeEquation

# How much each kind of knowledge counts: dynamics, the rate at the start (which fast dynamics keep
# up for much less than T), cost, rows.
_DYNAMICS, _RATE, _COST, _ROW = 1.0, 0.2, 0.3, 0.5
#: What is left of terms that cancel, relative to them, is rounding.
ROUNDING = 1e-9
# What changes by more than this part of itself with a tick of the clock, a part of the horizon, is
# decided by rounding.
_UNSTEADY, _TICK = 0.5, 1e-12
# Beside a point, at so many others, a called function has its usual size, of which this is noise.
_BESIDE, _NOISE = 4, 1e-13
# Units do not make a number this small: it stands for a zero that one may divide by, as in the
# slope of a distance at a place of symmetry.
_NOTHING = 1e-100
# A row has at least this part of its distance from the bounds as its size.
_OF_DISTANCE = 0.1


class SizePoint(NamedTuple):
    """Where derivatives are taken: state, control, time, parameters."""

    x: np.ndarray
    u: np.ndarray
    t: float
    p: np.ndarray


@dataclass(frozen=True, eq=False)
class SizeFunctions:
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
    def of(cls, ocp: OCP) -> "SizeFunctions":
        """Build them."""
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

    def _values(self, function: ca.Function, point: SizePoint) -> list[np.ndarray]:
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

    def _without_rounding(self, function: ca.Function, point: SizePoint) -> list[np.ndarray]:
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

    def equations(self, point: SizePoint) -> Iterator[SizeEquation]:
        """Yield what dynamics and constraints at a point say of the sizes."""
        yield from self._of_dynamics(point)
        for c, function in self.constraints.values():
            value, jacobian = self._values(function, point)
            terms = np.abs(jacobian) @ np.abs(np.concatenate([point.x, point.u]))
            offset = _offset(c, value.ravel(), terms)
            for i, j in zip(*np.nonzero(usable(jacobian)), strict=True):
                if offset[i] > 0.0:
                    size = float(np.log(offset[i]) - np.log(abs(jacobian[i, j])))
                    is_limit = bool(np.ravel(c.lower)[i] != np.ravel(c.upper)[i])
                    yield SizeEquation(_ROW, (int(j),), (), size, is_limit)

    def rate_sizes(self, point: SizePoint) -> Iterator[SizeEquation]:
        """Yield what the rate at a point says of the sizes by itself."""
        rate, jacobian = self._values(self.dynamics, point)
        rate = self.horizon * rate.ravel()
        terms = self.horizon * np.abs(jacobian) @ np.abs(np.concatenate([point.x, point.u]))
        for i in np.flatnonzero(usable(rate) & (np.abs(rate) > ROUNDING * terms)).tolist():
            yield SizeEquation(_RATE, (i,), (), float(np.log(abs(rate[i]))))

    def _of_dynamics(self, point: SizePoint) -> Iterator[SizeEquation]:
        jacobian = self.horizon * self._values(self.dynamics, point)[1]
        for i, j in zip(*np.nonzero(usable(jacobian)), strict=True):
            if i != j:
                gain = float(np.log(abs(jacobian[i, j])))
                yield SizeEquation(_DYNAMICS, (int(i),), (int(j),), gain)

    def of_curvature(self, point: SizePoint, beside: SizePoint) -> Iterator[SizeEquation]:
        """Yield what the change of the cost's slopes between two points says of the sizes."""
        here, there = ([np.array(v).ravel() for v in self.costs(*at)] for at in (point, beside))
        moved = np.concatenate([beside.x - point.x, beside.u - point.u])
        for share, i in ((self.horizon, 1), (1.0, 4)):
            change = there[i] - here[i]
            change[np.abs(change) <= ROUNDING * np.abs(here[i])] = 0.0
            for j in np.flatnonzero(usable(change) & usable(moved)).tolist():
                curvature = share * abs(change[j] / moved[j])
                yield SizeEquation(_COST, (len(moved),), (j, j), float(np.log(curvature)))

    def of_costs(self, point: SizePoint) -> Iterator[SizeEquation]:
        """Yield what values and slopes of the cost at a point say of the sizes."""
        values = [v.ravel() for v in self._values(self.costs, point)]
        cost = len(values[1])  # its place among the sizes
        for share, (value, slope, by_p) in ((self.horizon, values[:3]), (1.0, values[3:])):
            own = share * np.concatenate([value, by_p * point.p])
            for size in own[usable(own)]:
                yield SizeEquation(_COST, (cost,), (), float(np.log(abs(size))))
            for j in np.flatnonzero(usable(slope)).tolist():
                yield SizeEquation(_COST, (cost,), (j,), float(np.log(share * abs(slope[j]))))

    def row_sizes(self, c: Constraint, points: Iterable[SizePoint], w: np.ndarray) -> np.ndarray:
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
    distance[distance <= ROUNDING * np.maximum(np.abs(value), terms)] = 0.0
    largest = distance.max(axis=0)
    return np.where(usable(largest), largest, 0.0)


def usable(values: np.ndarray) -> np.ndarray:
    """Return which values are sizes of something: finite, and not zero but for rounding."""
    return np.isfinite(values) & (np.abs(values) > _NOTHING)
