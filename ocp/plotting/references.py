r"""Which signal or parameter is the reference of which variable, read off the running cost.

A signal s is the reference of a variable v if the cost depends on s only by way of v - s:
:math:`L = g(v - s) + r(v)`. Then, for any g and any step h, second differences say so without a
derivative:

.. math::

    L(v + h, s + h) - L(v + h, s) - L(v, s + h) + L(v, s)
    = -[L(v, s - h) - 2 L(v, s) + L(v, s + h)] \ne 0
"""

import casadi as ca
import numpy as np

from ocp.plotting.trajectory import Trajectory
from ocp.problem.parameters import Parameter, Signal

# Instants at which it is tried, and how well both sides have to agree.
_TRIED, _SAME = 5, 1e-6


def references_of(way: Trajectory) -> dict[int, tuple[str, int]]:
    """Return place in p -> (name, which of states, controls and algebraic variables it is for)."""
    ocp = way.ocp
    places, names, first = [], [], 0
    for entry in ocp.entries:
        size = entry.symbol.numel()
        if isinstance(entry, Parameter | Signal):
            places += range(first, first + size)
            names += names_of(entry)
        first += size
    cost = ca.SX(ocp.running_cost)
    if not places or not ca.depends_on(cost, ocp.p):
        return {}
    tried = _Tried(way, cost)
    found = {}
    for place, name in zip(places, names, strict=True):
        if ca.depends_on(cost, ocp.p[place]):
            owners = [k for k in range(way.variables.shape[1]) if tried.follows(k, place)]
            if len(owners) == 1:
                found[place] = (name, owners[0])
    return found


def names_of(entry: Parameter | Signal) -> list[str]:
    """Return the name of every component of a parameter or signal."""
    size = entry.symbol.numel()
    return [entry.name] if size == 1 else [str(entry.symbol[i]) for i in range(size)]


class _Tried:
    """The running cost at a few instants, with a variable or a parameter moved."""

    def __init__(self, way: Trajectory, cost: ca.SX) -> None:
        m = way.ocp.model
        self._cost = ca.Function("cost", [m.x, m.u, m.z, m.t, way.ocp.p], [ca.densify(cost)])
        self._at = np.unique(np.linspace(0, len(way.t) - 1, _TRIED + 2).astype(int)[1:-1])
        self._way = way

    def follows(self, variable: int, place: int) -> bool:
        """Whether the cost depends on p[place] only by its distance from the variable."""
        v, s = self._way.variables[:, variable], self._way.p[:, place]
        h = 0.1 * max(float(np.ptp(v)), float(np.abs(v - s).max())) or 1.0

        def moved(by_v: float, by_s: float) -> np.ndarray:
            return self._costs(variable, by_v * h, place, by_s * h)

        here = moved(0, 0)
        mixed = moved(1, 1) - moved(1, 0) - moved(0, 1) + here
        second = moved(0, -1) - 2 * here + moved(0, 1)
        size = np.abs([mixed, second, _SAME * here]).max()
        if not np.isfinite(size) or np.abs(second).max() <= _SAME * np.abs(here).max():
            return False
        return bool(np.abs(mixed + second).max() <= _SAME * size)

    def _costs(self, variable: int, by_v: float, place: int, by_s: float) -> np.ndarray:
        m, way = self._way.ocp.model, self._way
        v, p = way.variables[self._at].copy(), way.p[self._at].copy()
        v[:, variable] += by_v
        p[:, place] += by_s
        x, u, z = np.split(v, [m.nx, m.nx + m.nu], axis=1)
        given = (x, u, z, way.t[self._at, None], p)
        return np.array(self._cost.map(len(self._at))(*[a.T for a in given])).ravel()
