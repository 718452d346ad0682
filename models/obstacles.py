"""Obstacles: discs, capsules and convex polygons, at rest or moving."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Self

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._convex import counter_clockwise
from models._numbers import vector
from models.arm import PlanarArm
from models.distances import signed_distance
from ocp import ProblemError
from ocp.internal import check_instance, check_not_negative, check_positive

Point = ca.SX | ArrayLike
# Directions in which the outline of an obstacle is drawn.
_DIRECTIONS = 181


class Obstacle(ABC):
    """A convex core, grown by a radius, that the arm should not touch.

    Distances are measured from the core: it is at least ``radius`` where the arm is clear.

    Attributes:
        radius: d_b [m].
        smoothness: of the distance from the core: 1 where only its second derivative jumps,
            0 where it has kinks.
    """

    radius: float
    smoothness: ClassVar[Literal[0, 1]]

    @property
    @abstractmethod
    def core(self) -> ca.SX | ca.DM:
        """The corners of the core, counter-clockwise (2, k) [m], for casadi."""

    @abstractmethod
    def moved(self, by: Point) -> Self:
        """Return the obstacle shifted (2,) [m], by an expression in time if it moves."""

    def moving(self, velocity: ArrayLike, t: ca.SX) -> Self:
        """Return the obstacle that is here at t = 0 and moves straight on.

        For any other motion there is ``moved(expression)``: of time and parameters, or the
        symbol of a ``Signal``.

        Args:
            velocity: (2,) [m/s].
            t: the symbol of time [s], the one that the problem gets.

        Raises:
            ProblemError: on a wrong size or NaN.
        """
        return self.moved(t * ca.DM(vector(velocity, 2, "moving: velocity")))

    def outline(self, extra: float = 0.0, *, t: ca.SX | None = None, at: float = 0.0) -> np.ndarray:
        """Return the boundary of core and radius, to be drawn (m, 2) [m].

        Args:
            extra: drawn this much [m] outside the boundary.
            t: the symbol of time [s] in the obstacle's position.
            at: the time [s].

        Raises:
            ProblemError: if the position depends on more than time.
        """
        core = self.core
        time = ca.SX.sym("t") if t is None else t
        others = [str(s) for s in ca.symvar(ca.SX(core)) if not ca.is_equal(s, time)]
        if others:
            raise ProblemError(f"outline: where the obstacle is depends on {', '.join(others)}")
        corners = np.array(ca.Function("core", [time], [core])(at)).T
        angle = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS)
        normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return corners[(normals @ corners.T).argmax(axis=1)] + (self.radius + extra) * normals


@dataclass(frozen=True, eq=False)
class Disc(Obstacle):
    """A disc.

    Args:
        center: (2,) [m], numbers, or an ``SX`` expression in time and parameters of the
            problem (a moving obstacle, an obstacle known only at run time).
        radius: d_b [m], positive.

    Raises:
        ProblemError: on a wrong size, NaN, or a radius that is not positive.
    """

    center: Point
    radius: float
    smoothness: ClassVar[Literal[0, 1]] = 1

    def __post_init__(self) -> None:
        """Check the numbers."""
        object.__setattr__(self, "center", _point(self.center, "disc: center"))
        radius = check_positive(self.radius, "disc: radius")
        object.__setattr__(self, "radius", radius)

    @property
    def core(self) -> ca.SX | ca.DM:
        """The centre (2, 1) [m]."""
        return _casadi(self.center)

    def moved(self, by: Point) -> "Disc":
        """Return the disc shifted (2,) [m]."""
        return replace(self, center=_shifted(self.center, by))


@dataclass(frozen=True, eq=False)
class Capsule(Obstacle):
    """All points close to a segment: a rod with round ends.

    Args:
        start: one end of the segment (2,) [m], numbers or an ``SX`` expression.
        end: the other end (2,) [m].
        radius: d_b [m], positive.

    Raises:
        ProblemError: on a wrong size, NaN, a radius that is not positive, or equal ends.
    """

    start: Point
    end: Point
    radius: float
    smoothness: ClassVar[Literal[0, 1]] = 0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("start", "end"):
            object.__setattr__(self, name, _point(getattr(self, name), f"capsule: {name}"))
        radius = check_positive(self.radius, "capsule: radius")
        object.__setattr__(self, "radius", radius)
        length = ca.SX(_casadi(self.end) - _casadi(self.start))
        if length.is_constant() and float(ca.norm_2(length)) == 0.0:
            raise ProblemError("capsule: start and end are the same point; take a Disc")

    @property
    def core(self) -> ca.SX | ca.DM:
        """Both ends (2, 2) [m]."""
        return ca.horzcat(_casadi(self.start), _casadi(self.end))

    def moved(self, by: Point) -> "Capsule":
        """Return the capsule shifted (2,) [m]."""
        return replace(self, start=_shifted(self.start, by), end=_shifted(self.end, by))


@dataclass(frozen=True, eq=False)
class Polygon(Obstacle):
    """A convex polygon, its edges moved outwards and its corners rounded by a margin.

    Args:
        corners: (k, 2) [m], k >= 3, in order around a convex shape, either way round.
        radius: d_b [m], the margin; 0 for the polygon itself.
        position: what is added to every corner (2,) [m], numbers or an ``SX`` expression.

    Raises:
        ProblemError: on fewer than three corners, on corners that are repeated or form no
            convex polygon (naming the corner), on wrong sizes and on NaN.
    """

    corners: ArrayLike
    radius: float = 0.0
    position: Point = (0.0, 0.0)
    smoothness: ClassVar[Literal[0, 1]] = 0

    def __post_init__(self) -> None:
        """Check the numbers."""
        object.__setattr__(self, "corners", counter_clockwise(self.corners))
        object.__setattr__(self, "position", _point(self.position, "polygon: position"))
        object.__setattr__(self, "radius", check_not_negative(self.radius, "polygon: radius"))

    @property
    def core(self) -> ca.SX | ca.DM:
        """The corners (2, k) [m]."""
        corners = np.asarray(self.corners)
        return ca.DM(corners.T) + ca.repmat(_casadi(self.position), 1, len(corners))

    def moved(self, by: Point) -> "Polygon":
        """Return the polygon shifted (2,) [m]."""
        return replace(self, position=_shifted(self.position, by))


def link_distances(arm: PlanarArm, theta: ca.SX | ArrayLike, obstacle: Obstacle) -> ca.SX:
    """Return the distance from the *core* of an obstacle to each link (n,) [m].

    The arm is clear of the obstacle where all are at least its radius.
    """
    check_instance(arm, PlanarArm, "link distances: arm")
    check_instance(obstacle, Obstacle, "link distances: obstacle")
    joints, core = arm.joints(theta), obstacle.core
    links = [(joints[:, i], joints[:, i + 1]) for i in range(arm.n)]
    return ca.vertcat(*[signed_distance(core, a, b) for a, b in links])


def _point(value: Point, what: str) -> ca.SX | np.ndarray:
    if not isinstance(value, ca.SX):
        return vector(value, 2, what)
    if value.shape != (2, 1):
        raise ProblemError(f"{what} has shape {value.shape}, (2, 1) is needed")
    return value


def _casadi(point: Point) -> ca.SX | ca.DM:
    return point if isinstance(point, ca.SX) else ca.DM(np.asarray(point, float))


def _shifted(point: Point, by: Point) -> ca.SX:
    return ca.SX(_casadi(point) + _casadi(_point(by, "moved: by")))
