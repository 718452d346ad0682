r"""Nominal sizes of states, controls, cost and rows, in which a problem is well scaled.

They are found in logarithms by least squares, so that they follow every change of units. With T
the horizon, and derivatives taken near start and guess, each of these asks two sizes to agree:

.. math::

    T \, |f_{i,x_j}| \, s_j = s_i, \qquad T \, |f_{i,u_j}| \, s_{u_j} = s_i, \qquad
    T \, |L_{x_j}| \, s_j = s_J, \qquad T \, |L_{x_j x_j}| \, s_j^2 = s_J, \qquad
    |c_{x_j}| \, s_j = |c - b|

and start, bounds, guess, T f at the start, and the cost itself are sizes by their numbers.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ocp.problem.constraint_rows import ConstraintRows
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Signal
from ocp.problem.size_equations import SizeEquation, solved
from ocp.problem.size_functions import ROUNDING, SizeFunctions, SizePoint, usable

# How much each kind of knowledge counts: what is declared, bounds, start and guess.
_DECLARED, _BOUND, _GIVEN = 100.0, 2.0, 1.0
# Rounds of least squares: the later ones take derivatives a size away from the start.
_ROUNDS = 3
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


def nominal_sizes(ocp: OCP) -> Sizes:
    """Return the nominal sizes of a problem; what the user declared as nominal stays."""
    functions, points = SizeFunctions.of(ocp), _points(ocp)
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


def _estimated(ocp: OCP, functions: SizeFunctions, points: list[SizePoint]) -> np.ndarray:
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
    ocp: OCP, functions: SizeFunctions, points: list[SizePoint], declared: np.ndarray
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


def _points(ocp: OCP) -> list[SizePoint]:
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
    p[np.abs(p) <= ROUNDING * np.abs(p).max(axis=0, initial=0.0)] = 0.0
    return [SizePoint(*each) for each in zip(x, u, ocp.duration * fractions, p, strict=True)]


def _peaks(ocp: OCP) -> np.ndarray:
    """Return the fractions of the horizon at which the samples of signals are largest."""
    found = []
    for entry in ocp.parameters:
        if isinstance(entry, Signal):
            row = int(np.abs(entry.value).max(axis=1).argmax())
            found.append(entry.knots[row])
    return np.setdiff1d(found, _FRACTIONS)


def _displaced(ocp: OCP, points: list[SizePoint], sizes: np.ndarray) -> list[SizePoint]:
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
        for j in np.flatnonzero(usable(largest)).tolist():
            size = float(np.log(largest[j]))
            yield SizeEquation(weight, (first + j,), (), size, weight == _BOUND)
