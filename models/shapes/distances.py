"""How far two shapes are apart, with exact derivatives."""

from functools import reduce
from typing import Literal

import casadi as ca

from models.shapes.cuboids import point_to_box, segment_to_box
from models.shapes.gap import Gap
from models.shapes.polyhedra import nearest_features, polyhedron_to_polyhedron
from models.shapes.pose import Pose
from models.shapes.segments import point_to_segment, segment_to_segment
from models.shapes.shapes import Capsule, ConvexHull, Cuboid, HalfSpace, Rounded, Shape, Sphere
from ocp import ProblemError
from ocp.internal import check_instance

# From the simplest core to the least simple: of two shapes the simpler one comes first.
_ORDER = (Sphere, Capsule, Cuboid, ConvexHull, HalfSpace)


def distance(a: Shape, b: Shape) -> ca.SX:
    r"""Return the distance of two shapes, negative where they overlap.

    With the radii r around the cores A and B,

    .. math:: d = \begin{cases} \min_{x \in A, y \in B} |x - y| & \text{apart} \\
        -\min \{ |z| : A + z \text{ and } B \text{ have no inside in common} \} & \text{else}
        \end{cases} \;\; - r_a - r_b

    Its first and second derivatives in both poses are exact and finite everywhere. Two segments
    that cross have no depth: there the cores are 0 apart, and beyond the distance grows again. At a
    point where the cores only touch at a corner of one the gradient is 0. How smooth it is, see
    ``distance_smoothness``.

    Args:
        a: a shape.
        b: another; at most one of them is a half-space.

    Returns:
        the distance [m], a scalar.

    Raises:
        ProblemError: for what is no shape, and for two half-spaces.
    """
    first, second = _sorted(a, b)
    if isinstance(second, HalfSpace):
        return reduce(ca.fmin, ca.vertsplit(heights(first, second)))
    radii = first.radius + second.radius
    return _gap(first, second, signed=True).distance - radii


def squared_core_distance(a: Shape, b: Shape) -> ca.SX:
    """Return the squared distance of the cores of two shapes, without their radii.

    It has no root: spheres and capsules are clear where it is at least ``(r_a + r_b)**2``, and its
    derivatives are cheaper than those of ``distance``. Where a sphere's or a capsule's core enters
    another core it is 0 or, for a polyhedron, the square of the depth: only ``distance`` tells
    inside from outside.

    Args:
        a: a shape with a radius.
        b: another.

    Returns:
        the square [m^2], a scalar.

    Raises:
        ProblemError: for what is no shape, and for a half-space, whose distance needs no root.
    """
    first, second = _sorted(a, b)
    if isinstance(second, HalfSpace):
        raise ProblemError("squared core distance: a half-space has none; take distance(a, b)")
    return _gap(first, second, signed=False).squared


def heights(body: Rounded, ground: HalfSpace) -> ca.SX:
    """Return how far the vertices of a body, less its radius, are above a half-space (k,) [m].

    Each is as smooth as the poses; their minimum, the distance, has kinks.
    """
    return ground.heights(body.points) - body.radius


def distance_smoothness(a: Shape, b: Shape) -> Literal[0, 1, 2]:
    """Return how often the distance of two shapes can be differentiated, cores apart.

    2 for a ball and a ball. 1 for a ball and anything with corners or edges, and for two shapes of
    which neither's rotation is an expression: there the second derivative jumps where other
    features become the nearest. 0 where bodies turn: the slope jumps where edges or faces become
    parallel, since the nearest points leap from one end to the other. A ball above a half-space:
    2; anything else above it: 0, but its ``heights`` are smooth.

    What overlaps has kinks, where another normal gives the least overlap.
    """
    first, second = _sorted(a, b)
    if isinstance(first, Sphere):
        return 2 if isinstance(second, Sphere | HalfSpace) else 1
    if isinstance(second, HalfSpace):
        return 0
    return 0 if first.pose.turns or second.pose.turns else 1


def _sorted(a: Shape, b: Shape) -> tuple[Rounded, Rounded | HalfSpace]:
    """Return two shapes, the simpler one first."""
    for shape, which in ((a, "first"), (b, "second")):
        check_instance(shape, Shape, f"distance: the {which} shape")
        if not isinstance(shape, _ORDER):
            known = ", ".join(kind.__name__ for kind in _ORDER)
            raise ProblemError(f"distance: {shape.kind} is none of {known}")
    first, second = sorted((_simplest(a), _simplest(b)), key=_rank)
    if not isinstance(first, Rounded) or not isinstance(second, Rounded | HalfSpace):
        raise ProblemError(
            "distance: two half-spaces overlap unless they are opposite; compare each with a body"
        )
    return first, second


def _rank(shape: Shape) -> int:
    return next(i for i, kind in enumerate(_ORDER) if isinstance(shape, kind))


def _simplest(shape: Shape) -> Shape:
    """Return a capsule without length as the ball that it is."""
    if isinstance(shape, Capsule) and shape.is_ball:
        return Sphere(shape.radius, pose=shape.pose @ Pose(position=shape.start))
    return shape


def _gap(first: Rounded, second: Rounded, *, signed: bool) -> Gap:
    """Return the gap of two cores, the simpler one first."""
    match first, second:
        case Sphere(), Sphere():
            none = ca.SX(3, 1)
            return Gap(second.pose.p - first.pose.p, none, none, ca.SX(0))
        case Sphere(), Capsule():
            return point_to_segment(first.pose.p, *ca.horzsplit(second.points))
        case Capsule(), Capsule():
            return segment_to_segment(first.points, second.points)
        case Sphere() | Capsule(), Cuboid():
            back, p = second.pose.R.T, second.pose.p
            ends = [ca.mtimes(back, end - p) for end in ca.horzsplit(first.points)]
            half = ca.DM(second.half)
            if isinstance(first, Sphere):
                return point_to_box(ends[0], half)
            return segment_to_box(ends[0], ends[1], half, signed=signed)
    choice = nearest_features(first.core, second.core)
    return polyhedron_to_polyhedron(choice, *second.pose.seen_from(first.pose))
