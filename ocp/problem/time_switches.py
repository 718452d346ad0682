"""Instants at which an expression switches by the clock: a pulse, a tariff, a maneuver."""

import casadi as ca
import numpy as np

from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.problem.parameters import ParameterValues
from ocp.problem.walk import operations

# Instants at which every difference is looked at, and halvings of what lies between two.
_LOOKS, _HALVINGS = 2001, 50
# Rounds in which the nearest approach of a difference to zero is looked for.
_ROUNDS = 30


def time_switches(ocp: OCP, t0: float, duration: float, values: ParameterValues) -> np.ndarray:
    """Return where comparisons of time and parameters alone change, as fractions of the horizon.

    A comparison a < b, or a sign, changes where a - b = 0. Zeros are found between 2001 instants,
    and where the difference comes nearest to zero between them, as that of a short pulse does;
    a function with more zeros between two instants than two may keep some.

    Args:
        ocp: the problem; its rates, running cost and path constraints are searched.
        t0: initial time [s].
        duration: of the horizon [s].
        values: parameters of the run.
    """
    differences = _differences(ocp)
    if differences is None:
        return np.empty(0)
    p = values.at(0.0).T

    def at(fractions: np.ndarray) -> np.ndarray:
        t = t0 + fractions[None, :] * duration
        return np.array(differences.map(len(fractions))(t, np.tile(p, len(fractions))))

    looks = np.linspace(0.0, 1.0, _LOOKS)
    found = [np.empty(0)]
    for row, d in enumerate(at(looks)):
        points, values_there = _with_nearest(lambda s, row=row: at(s)[row], looks, d)
        changes = np.flatnonzero(values_there[:-1] * values_there[1:] < 0.0)
        low, high = points[changes], points[changes + 1]
        sign = np.sign(values_there[changes])
        for _ in range(_HALVINGS if len(changes) else 0):
            middle = (low + high) / 2.0
            before = at(middle)[row] * sign > 0.0
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        found += [high, points[values_there == 0.0]]
    return np.unique(np.clip(np.concatenate(found), 0.0, 1.0))


def _with_nearest(d, looks: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return instants and differences, with those between where the difference is next to zero."""
    size = np.abs(values)
    inner = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
    inner &= (values[1:-1] * values[:-2] > 0.0) & (values[1:-1] * values[2:] > 0.0)
    at = np.flatnonzero(inner) + 1
    if not len(at) or len(at) == len(looks) - 2:  # constant
        return looks, values
    low, high = looks[at - 1], looks[at + 1]
    for _ in range(_ROUNDS):  # thirds
        left, right = low + (high - low) / 3.0, high - (high - low) / 3.0
        nearer = np.sign(values[at]) * d(left) < np.sign(values[at]) * d(right)
        low, high = np.where(nearer, low, left), np.where(nearer, right, high)
    middle = (low + high) / 2.0
    points = np.concatenate([looks, middle])
    order = np.argsort(points, kind="stable")
    return points[order], np.concatenate([values, d(middle)])[order]


@once_per_problem
def _differences(ocp: OCP) -> ca.Function | None:
    """Return (t, p) -> what is zero where a comparison of time alone changes, or None."""
    ocp = ocp.explicit
    m = ocp.model
    signals = [entry.symbol for entry in ocp.moving]
    others = ca.vertcat(m.x, m.u, *signals)
    along = (*ocp.at("path"), *ocp.at("integral"), *ocp.peaks)
    terms = [m.f, ca.SX(ocp.running_cost), *[c.expression for c in along]]
    found: dict[int, ca.SX] = {}
    for node in operations(ca.vertcat(*terms)):
        if node.op() in (ca.OP_LT, ca.OP_LE):
            difference = node.dep(0) - node.dep(1)
        elif node.op() == ca.OP_SIGN:
            difference = node.dep(0)
        else:
            continue
        if ca.depends_on(difference, m.t) and not ca.depends_on(difference, others):
            found.setdefault(node.element_hash(), difference)
    if not found:
        return None
    return ca.Function("differences", [m.t, ocp.p], [ca.densify(ca.vertcat(*found.values()))])
