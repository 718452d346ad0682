"""A curve of end configurations with the starts of their extremals, refined until they are near."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from solvers.indirect.reverse.reverse_flow import Starts
from solvers.indirect.reverse.self_motion import SelfMotion

# Points of the first, even scan on a unit of the curve's length.
_DENSITY = 20.0
# A start further from its manifold than this is an error of the integration.
_ASTRAY = 0.05
# Halvings of the first spacing after which a jump is left as it is; fewer where one side is lost.
_DEEPEST, _EDGE = 30, 6
# One halving more counts as much as a cost above the lowest that is this power of two higher.
_PATIENCE = 0.5
# Intervals that are halved before the cheapest are chosen anew.
_BATCH = 256


@dataclass(frozen=True, eq=False)
class Scan:
    """Extremals by the place of their end on a self-motion curve, a row each, in its order.

    Attributes:
        curve: the self-motion at t1.
        arc: place of the end on it, (K,).
        ends: configurations at t1, (K, nx).
        starts: configurations at t0, (K, nx); angles are not wrapped.
        costates: at t0, (K, nx).
        costs: of the motions, (K,).
        valid: whether the reverse integration stayed on the manifold, bool (K,).
        unresolved: jumps between neighbouring starts that were given up.
    """

    curve: SelfMotion
    arc: np.ndarray
    ends: np.ndarray
    starts: np.ndarray
    costates: np.ndarray
    costs: np.ndarray
    valid: np.ndarray
    unresolved: int = 0

    @property
    def distances(self) -> np.ndarray:
        """Distance between neighbouring starts, whole turns apart, (K - 1,)."""
        return np.linalg.norm(
            self.curve.manifold.periods.wrapped(np.diff(self.starts, axis=0)), axis=1
        )


Integrate = Callable[[np.ndarray], Starts]
Astray = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Scanner:
    """Scans curves.

    Attributes:
        integrate: end configurations (K, nx) -> where they began.
        astray: starts (K, nx) -> distance from the manifold of starts (K,).
        spacing: wanted distance of neighbouring starts, in the unit of the states.
        most: points on a curve at which refinement ends.
    """

    integrate: Integrate
    astray: Astray
    spacing: float
    most: int

    def at(self, curve: SelfMotion, arc: np.ndarray) -> Scan:
        """Integrate back from places on the curve."""
        ends = curve.at(arc)
        began = self.integrate(ends)
        numbers = np.column_stack([began.x, began.costate, began.cost])
        finite = np.asarray(np.isfinite(numbers).all(axis=1))
        x = np.where(finite[:, None], began.x, 0.0)
        valid = np.logical_and(finite, self.astray(x) <= _ASTRAY)
        costate = np.where(valid[:, None], began.costate, 0.0)
        return Scan(curve, arc, ends, x, costate, np.where(valid, began.cost, np.inf), valid)

    def scan(self, curve: SelfMotion) -> Scan:
        """Scan a whole curve, halving intervals until neighbouring starts are near.

        The cheapest motions are refined first: where the number of points does not suffice,
        the costly ones stay coarse.
        """
        count = max(32, round(_DENSITY * curve.length))
        first = curve.length / count
        found = self.at(curve, np.linspace(0.0, curve.length, count + 1))
        while len(found.arc) < self.most:
            wide = self._wide(found, first)
            if not wide.size:
                break
            wide = wide[self._urgency(found, wide, first)]
            wide = wide[: min(_BATCH, self.most - len(found.arc))]
            middles = (found.arc[wide] + found.arc[wide + 1]) / 2.0
            found = merged(found, self.at(curve, np.sort(middles)))
        left = self._too_far(found) & found.valid[:-1] & found.valid[1:]
        return replace(found, unresolved=int(left.sum()))

    def _wide(self, scan: Scan, first: float) -> np.ndarray:
        """Return the intervals to halve."""
        width, valid = np.diff(scan.arc), scan.valid
        both, one = valid[:-1] & valid[1:], valid[:-1] ^ valid[1:]
        deep = both & self._too_far(scan) & (width > first / 2.0**_DEEPEST)
        return np.flatnonzero(deep | (one & (width > first / 2.0**_EDGE)))

    def _urgency(self, scan: Scan, wide: np.ndarray, first: float) -> np.ndarray:
        """Return the order in which to halve intervals: cheap ones first, and wide ones.

        Cheap alone would spend all points in the first cascade of folds that is met.
        """
        valid = scan.costs[scan.valid]
        spread = (np.median(valid) - valid.min()) / 10.0 + np.finfo(float).tiny
        above = np.minimum(scan.costs[wide], scan.costs[wide + 1]) - valid.min()
        halvings = np.log2(first / np.diff(scan.arc)[wide])
        return np.argsort(np.log2(1.0 + above / spread) + _PATIENCE * halvings, kind="stable")

    def _too_far(self, scan: Scan) -> np.ndarray:
        return scan.distances > self.spacing


def merged(one: Scan, other: Scan) -> Scan:
    """Return the points of both, in order."""
    order = np.argsort(np.concatenate([one.arc, other.arc]), kind="stable")
    return Scan(
        curve=one.curve,
        arc=np.concatenate([one.arc, other.arc])[order],
        ends=np.concatenate([one.ends, other.ends])[order],
        starts=np.concatenate([one.starts, other.starts])[order],
        costates=np.concatenate([one.costates, other.costates])[order],
        costs=np.concatenate([one.costs, other.costs])[order],
        valid=np.concatenate([one.valid, other.valid])[order],
        unresolved=one.unresolved,
    )
