"""Where along a scan the condition at the start is met: brackets, folds, roots."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solvers.indirect.reverse.invariant_manifold import Manifold
from solvers.indirect.reverse.scan import Scan, Scanner, merged

# A root of the condition, and when to stop looking for it.
_ZERO, _MOST_ROUNDS = 1e-10, 60
# A bracket this narrow, relative to the curve, is rounding; every so many rounds one is halved.
_CLOSE, _BISECT = 1e-15, 4
# A bracket that ends with more is a jump, not a root.
_JUMP = 1e-6
_ZOOMS = 40

# Scan -> the condition's value at every point (K,), and where it is meaningful, bool (K,).
Condition = Callable[[Scan], tuple[np.ndarray, np.ndarray]]


def meets_start(start: Manifold, x0: np.ndarray, radius: float) -> Condition:
    """Return the condition of type 4: theta_int(t0) = theta0, along the start's self-motion.

    Args:
        start: the manifold at t0, one-dimensional.
        x0: the start (nx,), on it.
        radius: distance from x0 within which its tangent tells on which side a start is.
    """
    tangent = start.tangent(x0)[:, 0]

    def condition(scan: Scan) -> tuple[np.ndarray, np.ndarray]:
        away = start.periods.wrapped(scan.starts - x0)
        return away @ tangent, scan.valid & (np.linalg.norm(away, axis=1) <= radius)

    return condition


def is_transversal(start: Manifold) -> Condition:
    """Return the condition of types 2 and 3: the costate is normal to the start's manifold.

    Its value is psi(t0) along the tangent, which det [c_x; tangent'] > 0 orients the same way
    everywhere.
    """

    def condition(scan: Scan) -> tuple[np.ndarray, np.ndarray]:
        slopes = start.linearised(scan.starts)[1]
        tangents = np.linalg.svd(slopes)[2][:, -1]
        frames = np.concatenate([slopes, tangents[:, None, :]], axis=1)
        along = np.sign(np.linalg.det(frames)) * np.einsum("ki,ki->k", tangents, scan.costates)
        return along, scan.valid

    return condition


@dataclass(frozen=True, eq=False)
class Crossings:
    """Finds the places of a scan where a condition vanishes.

    Attributes:
        scanner: integrates more points.
        condition: what has to vanish.
    """

    scanner: Scanner
    condition: Condition

    def on(self, scan: Scan) -> Scan:
        """Return the roots: a scan of one point each, in the order of the curve."""
        for _ in range(_ZOOMS):
            folds = self._folds(scan)
            if not folds.size:
                break
            middles = np.concatenate([scan.arc[folds - 1], scan.arc[folds + 1]])
            middles = (middles + np.tile(scan.arc[folds], 2)) / 2.0
            scan = merged(scan, self.scanner.at(scan.curve, np.unique(middles)))
        return self._roots(scan)

    def _folds(self, scan: Scan) -> np.ndarray:
        """Return where the value turns back before zero, and may reach it between the points."""
        value, near = self.condition(scan)
        i = np.arange(1, len(value) - 1)
        i = i[near[i - 1] & near[i] & near[i + 1]]
        left, here, right = np.abs(value[i - 1]), np.abs(value[i]), np.abs(value[i + 1])
        turns = (here < left) & (here <= right)
        same = (np.sign(value[i - 1]) == np.sign(value[i])) & (
            np.sign(value[i + 1]) == np.sign(value[i])
        )
        # The parabola through three points stays above here - (the larger rise).
        reach = np.maximum(left, right) - here
        width = scan.arc[i + 1] - scan.arc[i - 1]
        return i[turns & same & (here <= reach) & (width > 1e-12 * scan.curve.length)]

    def _roots(self, scan: Scan) -> Scan:
        """Close in on every change of sign by regula falsi (Illinois), all at once."""
        value, near = self.condition(scan)
        k = np.flatnonzero(near[:-1] & near[1:] & (value[:-1] * value[1:] <= 0.0))
        arc = np.stack([scan.arc[k], scan.arc[k + 1]])
        f = np.stack([value[k], value[k + 1]])
        best = np.where(np.abs(f[0]) < np.abs(f[1]), arc[0], arc[1])
        error = np.abs(f).min(axis=0)
        lost = np.zeros(len(k), dtype=bool)
        for turn in range(_MOST_ROUNDS):
            wide = np.abs(arc[1] - arc[0]) > _CLOSE * scan.curve.length
            open_ = np.flatnonzero((error > _ZERO) & wide & ~lost)
            if not open_.size:
                break
            (a, b), (fa, fb) = arc[:, open_], f[:, open_]
            trial = (a + b) / 2.0 if turn % _BISECT == 0 else (a * fb - b * fa) / (fb - fa)
            here, near = self.condition(self.scanner.at(scan.curve, trial))
            lost[open_] = ~near  # the start leapt away in between: a jump, not a root
            better = near & (np.abs(here) < error[open_])
            best[open_[better]], error[open_[better]] = trial[better], np.abs(here[better])
            beyond = here * fb > 0.0
            arc[:, open_] = np.where(beyond, [a, trial], [trial, b])
            f[:, open_] = np.where(beyond, [fa / 2.0, here], [here, fb / 2.0])
        return self.scanner.at(scan.curve, best[error <= _JUMP])
