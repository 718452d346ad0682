"""Convex bodies in space: a core and a radius, placed by a pose."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import vector
from models.shapes.polyhedron import Polyhedron, checked_points, inner_points
from models.shapes.pose import Coordinates, Pose
from ocp import ProblemError
from ocp.internal import Portable, check_instance, check_not_negative, check_positive

# A capsule that is shorter is a ball [m].
_LENGTH = 1e-12


@dataclass(frozen=True, eq=False, kw_only=True)
class Shape(Portable, ABC):
    """All points within a radius of a convex core.

    Attributes:
        pose: where it is: numbers, or expressions in states, time, parameters and signals.
    """

    pose: Pose = field(default_factory=Pose)

    def __post_init__(self) -> None:
        """Check the pose."""
        check_instance(self.pose, Pose, f"{self.kind}: pose")

    @property
    def kind(self) -> str:
        """What messages call it."""
        return type(self).__name__

    def placed(self, pose: Pose) -> Self:
        """Return it as a part of a body that has this pose: link shapes by their kinematics."""
        check_instance(pose, Pose, f"{self.kind}: pose")
        return replace(self, pose=pose @ self.pose)

    def at(self, position: Coordinates, rotation: Coordinates | None = None) -> Self:
        """Return it turned by a rotation (3, 3), then shifted by a position (3,) [m]."""
        return self.placed(Pose(np.eye(3) if rotation is None else rotation, position))


class Rounded(Shape):
    """A bounded shape: its core is a point, a segment or a polyhedron.

    Attributes:
        radius: around the core [m].
    """

    radius: float

    @cached_property
    def core(self) -> Polyhedron:
        """The core in the shape's own frame."""
        return self._core()

    @property
    def points(self) -> ca.SX:
        """Where the vertices of the core are (3, k) [m]."""
        return self.pose.of(ca.sparsify(ca.DM(self.core.vertices.T)))

    @abstractmethod
    def _core(self) -> Polyhedron:
        """Return the core."""


@dataclass(frozen=True, eq=False)
class Sphere(Rounded):
    """A ball around the origin of its frame.

    Args:
        radius: [m], 0 for a point.
        pose: where it is.

    Raises:
        ProblemError: on a negative radius and on NaN.
    """

    radius: float

    def __post_init__(self) -> None:
        """Check the number."""
        super().__post_init__()
        object.__setattr__(self, "radius", check_not_negative(self.radius, "Sphere: radius"))

    def _core(self) -> Polyhedron:
        return Polyhedron.segment(np.zeros(3), np.zeros(3))

    @property
    def points(self) -> ca.SX:
        """Where the centre is (3, 1) [m]."""
        return self.pose.p


@dataclass(frozen=True, eq=False)
class Capsule(Rounded):
    """All points close to a segment: a rod with round ends.

    Args:
        start: one end of the segment (3,) [m], in its frame.
        end: the other end (3,) [m]; the same point makes it a ball.
        radius: [m], 0 for the segment itself.
        pose: where it is.

    Raises:
        ProblemError: on a wrong size, a negative radius, and NaN.
    """

    start: ArrayLike
    end: ArrayLike
    radius: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
        for name in ("start", "end"):
            ends = vector(getattr(self, name), 3, f"Capsule: {name}")
            object.__setattr__(self, name, ends)
        object.__setattr__(self, "radius", check_not_negative(self.radius, "Capsule: radius"))

    @property
    def is_ball(self) -> bool:
        """Whether it has no length."""
        return float(np.linalg.norm(np.asarray(self.end) - np.asarray(self.start))) < _LENGTH

    def _core(self) -> Polyhedron:
        return Polyhedron.segment(self.start, self.end)


@dataclass(frozen=True, eq=False)
class Cuboid(Rounded):
    """A box around the origin of its frame, with edges along its axes.

    Args:
        size: lengths of the edges (3,) [m], positive.
        radius: by which it is grown and its edges are rounded [m].
        pose: where it is.

    Raises:
        ProblemError: on a wrong size, a length that is not positive, a negative radius, and NaN.
    """

    size: ArrayLike
    radius: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
        size = vector(self.size, 3, "Cuboid: size")
        for i, length in enumerate(size.tolist()):
            check_positive(length, f"Cuboid: size[{i}]")
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "radius", check_not_negative(self.radius, "Cuboid: radius"))

    @property
    def half(self) -> np.ndarray:
        """Half the lengths of its edges (3,) [m]."""
        return np.asarray(self.size) / 2.0

    def _core(self) -> Polyhedron:
        signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        return Polyhedron.hull(signs * self.half)


@dataclass(frozen=True, eq=False)
class ConvexHull(Rounded):
    """The convex body with given vertices.

    Distances between two of them compare every edge of one with every edge of the other: give
    some tens of vertices, not thousands.

    Args:
        vertices: (k >= 4, 3) [m], in its frame, not in one plane.
        radius: by which it is grown and its edges are rounded [m].
        pose: where it is.

    Raises:
        ProblemError: on a wrong shape, NaN, a flat body, a negative radius, and a vertex that is
            no corner (naming it): the body that is meant is then not convex.
    """

    vertices: ArrayLike
    radius: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
        points = checked_points(self.vertices, "ConvexHull: vertices")
        if (inner := inner_points(points)).size:
            raise ProblemError(
                f"ConvexHull: vertices[{inner[0]}] is no corner of a convex body; split the body "
                "into convex ones, or take ConvexHull.around(points), which leaves such points out"
            )
        object.__setattr__(self, "vertices", points)
        object.__setattr__(self, "radius", check_not_negative(self.radius, "ConvexHull: radius"))

    @classmethod
    def around(cls, points: ArrayLike, radius: float = 0.0) -> "ConvexHull":
        """Return the hull of any points (k, 3) [m], such as the vertices of a mesh."""
        found = checked_points(points, "ConvexHull.around: points")
        corners = np.setdiff1d(np.arange(len(found)), inner_points(found))
        return cls(found[corners], radius)

    def _core(self) -> Polyhedron:
        return Polyhedron.hull(np.asarray(self.vertices))


@dataclass(frozen=True, eq=False)
class HalfSpace(Shape):
    """Everything on one side of a plane: floor, ceiling, wall.

    Args:
        normal: out of the half-space (3,), of any length but zero, in its frame.
        offset: how far along the normal the plane is from the origin of its frame [m].
        pose: where it is.

    Raises:
        ProblemError: on a wrong size, NaN, and a normal of length zero.
    """

    normal: ArrayLike
    offset: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
        normal = vector(self.normal, 3, "HalfSpace: normal")
        largest = float(np.abs(normal).max())
        if largest == 0.0:
            raise ProblemError("HalfSpace: normal has length zero; it points out of the half-space")
        normal = normal / largest  # so that no square is beyond all numbers
        object.__setattr__(self, "normal", normal / np.linalg.norm(normal))
        offset = vector(self.offset, 1, "HalfSpace: offset")
        object.__setattr__(self, "offset", float(offset[0]))

    def heights(self, points: ca.SX) -> ca.SX:
        """Return how far points (3, k) are above the plane (k,) [m]."""
        n = ca.mtimes(self.pose.R, ca.sparsify(ca.DM(np.asarray(self.normal))))
        return ca.mtimes(points.T, n) - (ca.dot(n, self.pose.p) + self.offset)
