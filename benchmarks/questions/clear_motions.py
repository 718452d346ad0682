r"""Whether any motion of a three-link arm keeps a clearance: decided over all configurations.

No optimal control problem is solved here. With absolute angles φ of the first two links, joints
at p1(φ1) and p2(φ1, φ2), an end effector at r(t) leaves the level curve

.. math:: \{(\varphi_1, \varphi_2) : |p_2(\varphi_1, \varphi_2) - r(t)| = l_3\}

of the torus, the self-motion at t; the last link follows from it. A motion is a continuous walk
on these curves, at any speed. The torus is cut into squares and the time into slabs, and a box
(square times slab) is *possible* unless a bound shows that none of its configurations reaches
r(t), or none is clear. Distances to the three links change by no more than the joint that moves
most, so the bounds need no derivative: with half a side w and half a slab τ

.. math:: h = \max\bigl((l_1 + l_2) \, w, |\dot r| \tau\bigr)

covers what the clearance does within a box. A clear motion passes through possible boxes only,
from one to one that touches it. Where those that are connected with the start end before the
last slab, there is **certainly no clear motion**, whatever the solver. Where they reach the last
slab, the boxes decide nothing: up to h may be missing to a clear motion. That there is one is
then shown by a motion that the referee accepts.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from models import ArmScenario
from ocp import ProblemError

# A side of 6 mm at the end of two links of 1 m: enough for all that is asked here.
SQUARES = 1024
_COARSEST = 64
# Each of eight neighbours once.
_NEIGHBOURS = ((1, 0), (0, 1), (1, 1), (1, -1))


@dataclass(frozen=True)
class Sweep:
    """What a sweep over the boxes found.

    Attributes:
        clearance: asked for, from the disc's centre [m].
        reach: fraction of the horizon at which the possible boxes end; 1: they do not.
        resolution: h, by how much the clearance of a box may be overrated [m].
    """

    clearance: float
    reach: float
    resolution: float

    @property
    def is_infeasible(self) -> bool:
        """Whether there is certainly no clear motion."""
        return self.reach < 1.0


def clear_motions(scenario: ArmScenario, clearance: float, *, squares: int = SQUARES) -> Sweep:
    """Sweep over all configurations of a scenario, forward in time.

    Args:
        scenario: with three links.
        clearance: that every link has to keep from the disc's centre [m].
        squares: per turn of an angle, 64 times a power of two; there are as many slabs that
            the end effector moves no further in one than p2 within a square.

    Raises:
        ProblemError: if the arm has not three links, or for another number of squares.
    """
    times = squares // _COARSEST
    if times < 1 or squares != times * _COARSEST or times & (times - 1):
        raise ProblemError(f"clear motions: squares = {squares}, not 64 times a power of two")
    boxes = _Boxes.of(scenario, squares)
    reached = boxes.around_start(np.array(scenario.theta0))
    for k in range(boxes.slabs):
        possible = boxes.possible(k, clearance)
        reached = _connected(possible, reached, squares)
        if not reached.size:
            return Sweep(clearance, k / boxes.slabs, boxes.resolution)
    return Sweep(clearance, 1.0, boxes.resolution)


def widest_clearance(
    scenario: ArmScenario, *, squares: int = SQUARES, accuracy: float = 1e-3
) -> float:
    """Return a clearance that certainly no motion keeps [m], nearly the smallest known so.

    Args:
        scenario: with three links.
        squares: see ``clear_motions``.
        accuracy: of the bisection [m]; the boxes overrate by up to their resolution besides.
    """
    # The base is never further away than this.
    low, high = 0.0, 2.0 * accuracy + float(np.linalg.norm(scenario.obstacle))
    while high - low > accuracy:
        middle = (low + high) / 2.0
        if clear_motions(scenario, middle, squares=squares).is_infeasible:
            high = middle
        else:
            low = middle
    return high


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Squares of the torus times slabs of time; a square is the number i N + j."""

    lengths: np.ndarray
    disc: np.ndarray
    start: np.ndarray
    travel: np.ndarray
    squares: int
    slabs: int

    @classmethod
    def of(cls, scenario: ArmScenario, squares: int) -> "_Boxes":
        if len(scenario.lengths) != 3:
            raise ProblemError(f"clear motions: {scenario.name} has not three links")
        lengths = np.array(scenario.lengths)
        start = np.array(scenario.arm.end_effector(scenario.theta0)).ravel()
        travel = scenario.horizon * np.array(scenario.velocity)
        across = 2.0 * (lengths[0] + lengths[1]) * np.pi / squares
        slabs = max(1, int(np.ceil(np.linalg.norm(travel) / across)))
        return cls(lengths, np.array(scenario.obstacle), start, travel, squares, slabs)

    @property
    def resolution(self) -> float:
        """By how much the clearance changes from the centre of a box to its corners [m]."""
        return max(self._swing(self.squares), self._shift)

    @property
    def _shift(self) -> float:
        """How far r moves in half a slab [m]."""
        return float(np.linalg.norm(self.travel)) / self.slabs / 2.0

    def _swing(self, squares: int) -> float:
        """How far p2 moves from the centre of a square to its corners [m], or less."""
        return float(self.lengths[0] + self.lengths[1]) * np.pi / squares

    def around_start(self, theta0: np.ndarray) -> np.ndarray:
        """Return the squares that the start configuration is in, or on the border of."""
        place = np.cumsum(theta0)[:2] / (2.0 * np.pi) * self.squares
        near = {
            (int(np.floor(place[0] + a)) % self.squares, int(np.floor(place[1] + b)) % self.squares)
            for a in (-1e-9, 1e-9)
            for b in (-1e-9, 1e-9)
        }
        return np.array(sorted(i * self.squares + j for i, j in near))

    def possible(self, slab: int, clearance: float) -> np.ndarray:
        """Return the possible squares of a slab, sorted: coarse ones are split where possible."""
        target = self.start + (slab + 0.5) / self.slabs * self.travel
        count = _COARSEST
        i, j = (axis.ravel() for axis in np.mgrid[:count, :count])
        while True:
            keep = self._may_be_clear(i, j, count, target, clearance)
            i, j = i[keep], j[keep]
            if count == self.squares:
                return np.sort(i * count + j)
            i = (2 * i[:, None] + np.array([0, 0, 1, 1])).ravel()
            j = (2 * j[:, None] + np.array([0, 1, 0, 1])).ravel()
            count *= 2

    def _may_be_clear(
        self, i: np.ndarray, j: np.ndarray, count: int, target: np.ndarray, clearance: float
    ) -> np.ndarray:
        """Whether a box may hold a configuration that reaches its target and is clear."""
        p1 = self.lengths[0] * _directions(i, count)
        p2 = p1 + self.lengths[1] * _directions(j, count)
        swing, shift = self._swing(count), self._shift
        missed = np.abs(np.linalg.norm(p2 - target, axis=1) - self.lengths[2])
        near = np.flatnonzero(missed <= swing + shift)
        p1, p2 = p1[near], p2[near]
        base, tip = np.zeros(2), np.broadcast_to(target, p2.shape)
        links = ((np.broadcast_to(base, p1.shape), p1), (p1, p2), (p2, tip))
        closest = np.min([_distance(self.disc, a, b) for a, b in links], axis=0)
        keep = np.zeros(len(i), dtype=bool)
        keep[near] = closest + max(swing, shift) >= clearance
        return keep


def _directions(k: np.ndarray, count: int) -> np.ndarray:
    angle = (k + 0.5) * (2.0 * np.pi / count)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _distance(point: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distance from a point to segments (K, 2) to (K, 2) [m]."""
    along = b - a
    square = np.maximum(np.einsum("ki,ki->k", along, along), np.finfo(float).tiny)
    share = np.clip(np.einsum("ki,ki->k", point - a, along) / square, 0.0, 1.0)
    return np.linalg.norm(point - a - share[:, None] * along, axis=1)


def _connected(possible: np.ndarray, reached: np.ndarray, squares: int) -> np.ndarray:
    """Return the possible squares that touch, over others, those that were reached."""
    here = np.searchsorted(possible, reached)
    here = here[here < len(possible)]
    seeds = here[np.isin(possible[here], reached)]
    if not seeds.size:
        return seeds
    i, j = np.divmod(possible, squares)
    pairs = [_pairs(possible, (i + a) % squares * squares + (j + b) % squares)
             for a, b in _NEIGHBOURS]  # fmt: skip
    first, second = (np.concatenate(side) for side in zip(*pairs, strict=True))
    size = len(possible)
    graph = coo_matrix((np.ones(len(first), dtype=bool), (first, second)), shape=(size, size))
    _, component = connected_components(graph, directed=False)
    return possible[np.isin(component, component[seeds])]


def _pairs(possible: np.ndarray, neighbours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of squares and of their neighbours, where those are possible too."""
    at = np.minimum(np.searchsorted(possible, neighbours), len(possible) - 1)
    first = np.flatnonzero(possible[at] == neighbours)
    return first, at[first]
