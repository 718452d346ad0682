"""The self-motion of a redundant system: the curves it can move along, its task held."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ocp import ProblemError, UnsupportedProblem
from ocp.internal import check_instance, check_positive, check_whole
from solvers.indirect.reverse.invariant_manifold import Manifold, out_of_reach, redundant_by_one

# Largest turn of the tangent in one step [rad].
_TURN = 0.15
_CORRECTIONS = 12
_ON = 1e-11
_MOST_POINTS = 50_000
_SMALLEST = 1e-6
SEEDS = 64


@dataclass(frozen=True, eq=False)
class SelfMotion:
    """A closed curve of configurations.

    Attributes:
        manifold: the set it is a component of.
        points: (K + 1, nx), the last one the first one again, up to whole turns of angles.
        arc: arclength of the points (chords added up), (K + 1,).
    """

    manifold: Manifold
    points: np.ndarray
    arc: np.ndarray

    @property
    def length(self) -> float:
        """Arclength of the whole curve, in the unit of the states."""
        return float(self.arc[-1])

    def at(self, arc: np.ndarray) -> np.ndarray:
        """Return the configurations (K, nx) at values of the arclength, once round or less."""
        rows = np.stack([np.interp(arc, self.arc, column) for column in self.points.T], axis=1)
        return self.manifold.projected(rows)[0]

    def distance(self, x: np.ndarray) -> float:
        """Return the distance of a configuration from the chords, whole turns apart."""
        start, chords = self.points[:-1], np.diff(self.points, axis=0)
        away = self.manifold.periods.wrapped(x - start)
        share = np.einsum("ki,ki->k", away, chords) / np.einsum("ki,ki->k", chords, chords)
        nearest = np.clip(share, 0.0, 1.0)[:, None] * chords
        return float(np.linalg.norm(away - nearest, axis=1).min())


def self_motions(
    manifold: Manifold, seeds: Sequence[np.ndarray] | np.ndarray, step: float = 0.05
) -> tuple[SelfMotion, ...]:
    """Trace every component of a one-dimensional manifold that a seed leads to.

    Each seed is moved onto the manifold; where it arrives away from the curves that are known,
    a new one is traced by pseudo-arclength continuation: a step along the tangent, then
    Newton on the equations and the plane at right angles to the tangent, until the curve
    closes (up to whole turns of angles). Turning points are points like any other
    [Deuflhard 2004, ch. 5].

    Args:
        manifold: with redundancy one.
        seeds: configurations (K, nx) to begin with.
        step: largest step, in the unit of the states; smaller where the curve bends.

    Raises:
        UnsupportedProblem: if the redundancy is not one, or a curve does not close.
        ProblemError: if no seed reaches the manifold: the target is out of reach.
    """
    check_instance(manifold, Manifold, "self_motions: manifold")
    check_positive(step, "self_motions: step")
    redundant_by_one(manifold)
    rows, arrived = manifold.projected(np.asarray(seeds, dtype=float))
    if not arrived.any():
        raise ProblemError(out_of_reach(manifold, rows))
    found: list[SelfMotion] = []
    for x in rows[arrived]:
        if all(curve.distance(x) > 0.1 * step for curve in found):
            found.append(_traced(manifold, x, step))
    return tuple(found)


def seeds_around(manifold: Manifold, x: np.ndarray, count: int = SEEDS) -> np.ndarray:
    """Return a configuration and random ones, angles all round, other states about it.

    Args:
        manifold: which says what is an angle.
        x: the configuration (nx,), the first row of the answer.
        count: rows of the answer (count, nx); always the same for the same x.
    """
    check_instance(manifold, Manifold, "seeds_around: manifold")
    check_whole(count, "seeds_around: count")
    rng, finite = np.random.default_rng(0), np.isfinite(manifold.periods.of_states)
    width = np.where(finite, np.where(finite, manifold.periods.of_states, 0.0) / 2.0, 1.0 + abs(x))
    return np.vstack([x, x + rng.uniform(-1.0, 1.0, (count - 1, len(x))) * width])


def _traced(manifold: Manifold, first: np.ndarray, largest: float) -> SelfMotion:
    """Walk along the curve until it comes back."""
    x, start = first, manifold.tangent(first)[:, 0]
    tangent, step, points = start, largest, [first]
    while len(points) < _MOST_POINTS:
        trial = _corrected(manifold, x, tangent, step)
        turned = None if trial is None else _along(manifold.tangent(trial)[:, 0], tangent)
        if trial is None or turned is None or turned @ tangent < np.cos(_TURN):
            step /= 2.0
            if step < _SMALLEST * largest:
                raise UnsupportedProblem(
                    f"the self-motion of {manifold.name} cannot be followed beyond {x}: "
                    "it branches, or its equations are not smooth there"
                )
            continue
        if len(points) > 2 and _passes(manifold, first, start, x, trial, largest):
            points.append(first + manifold.periods.turns(trial - first))
            return _curve(manifold, np.array(points))
        points.append(trial)
        if turned @ tangent > np.cos(_TURN / 3.0):
            step = min(largest, 1.5 * step)
        x, tangent = trial, turned
    raise UnsupportedProblem(
        f"the self-motion of {manifold.name} does not close within {_MOST_POINTS} points"
    )


def _corrected(
    manifold: Manifold, x: np.ndarray, tangent: np.ndarray, step: float
) -> np.ndarray | None:
    """Return the next point, or None where Newton does not reach it or reaches too far."""
    predicted = x + step * tangent
    y = predicted
    for _ in range(_CORRECTIONS):
        values, slopes = manifold.linearised(y[None, :])
        if np.abs(values).max() <= _ON:
            return y if np.linalg.norm(y - predicted) <= 0.5 * step else None
        system = np.vstack([slopes[0], tangent])
        right = np.append(values[0], tangent @ (y - predicted))
        y = y - np.linalg.lstsq(system, right, rcond=None)[0]
    return None


def _along(tangent: np.ndarray, before: np.ndarray) -> np.ndarray:
    return tangent if tangent @ before >= 0.0 else -tangent


def _passes(
    manifold: Manifold,
    first: np.ndarray,
    start: np.ndarray,
    x: np.ndarray,
    trial: np.ndarray,
    near: float,
) -> bool:
    """Whether the step from x to trial goes through the first point."""
    before, after = (manifold.periods.wrapped(y - first) for y in (x, trial))
    if max(np.linalg.norm(before), np.linalg.norm(after)) > 1.5 * near:
        return False
    return bool(start @ before < 0.0 <= start @ after)


def _curve(manifold: Manifold, points: np.ndarray) -> SelfMotion:
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return SelfMotion(manifold, points, np.concatenate([[0.0], np.cumsum(chords)]))
