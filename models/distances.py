"""How far a link is from a point or from a convex polygon, negative where they overlap."""

from functools import reduce

import casadi as ca

# Added under the root [m^2]: at distance 0 the gradient is then 0 instead of NaN, and
# a distance of 1 mm changes by 5e-16 m.
_ROOT = 1e-18
# Added to the squared length of a segment [m^2]: one of length 0 is then a point.
_POINT = 1e-30
# Further inside than anything [m]: what has no direction separates nothing.
_FAR = 1e9


def distance_to_segment(point: ca.SX | ca.DM, a: ca.SX | ca.DM, b: ca.SX | ca.DM) -> ca.SX:
    """Return the distance from a point to the segment from ``a`` to ``b``.

    It is once continuously differentiable but at distance 0: the second derivative jumps
    where the nearest point reaches an end of the segment. At distance 0 the gradient is 0.

    Args:
        point: (2,) [m], expression or ``DM``.
        a: one end (2,) [m].
        b: the other end (2,) [m]; ``a == b`` is a point.

    Returns:
        the distance [m], a scalar.
    """
    along = b - a
    share = ca.dot(point - a, along) / (ca.sumsqr(along) + _POINT)
    nearest = a + ca.fmax(0.0, ca.fmin(1.0, share)) * along
    return ca.sqrt(ca.sumsqr(point - nearest) + _ROOT)


def signed_distance(corners: ca.SX | ca.DM, a: ca.SX, b: ca.SX) -> ca.SX:
    r"""Return the distance from a convex polygon to the segment from ``a`` to ``b``.

    Apart, it is the distance of their nearest points. Where they overlap it is minus the
    length of the shortest shift that parts them: with outward normals n of both shapes,

    .. math:: d = \max_n \Bigl( \min_{x \in ab} n'x - \max_{y \in P} n'y \Bigr) \le 0

    The gradient is finite everywhere and of unit length at contact with an edge. It jumps
    where link and edge are parallel (the nearest points leap), and inside where another
    normal takes over.

    Args:
        corners: (2, k) [m], counter-clockwise; k = 1 is a point, whose distance is never
            negative, k = 2 a segment.
        a: one end of the link (2,) [m].
        b: the other end (2,) [m].

    Returns:
        the distance [m], a scalar.
    """
    points = ca.horzsplit(corners)
    if len(points) == 1:
        return distance_to_segment(points[0], a, b)
    edges = list(zip(points, [*points[1:], points[0]], strict=True))
    gaps = [*_across_link(points, a, b), *[_across_edge(e, a, b) for e in edges]]
    if len(points) == 2:  # has no area: in line with the link, only its ends part them
        gaps += [_beyond_end(e, a, b) for e in edges]
    gap = reduce(ca.fmax, gaps)
    apart = [distance_to_segment(point, a, b) for point in points]
    apart += [distance_to_segment(end, *edge) for edge in edges for end in (a, b)]
    return ca.if_else(gap > 0.0, reduce(ca.fmin, apart), gap)


def _across_edge(edge: tuple, a: ca.SX, b: ca.SX) -> ca.SX:
    """How far the link lies beyond the line through an edge."""
    normal = _right_of(edge[1] - edge[0])
    return ca.fmin(ca.dot(normal, a - edge[0]), ca.dot(normal, b - edge[0]))


def _beyond_end(edge: tuple, a: ca.SX, b: ca.SX) -> ca.SX:
    """How far the link lies beyond the second end of an edge, along it."""
    along = -_right_of(_right_of(edge[1] - edge[0]))
    return ca.fmin(ca.dot(along, a - edge[1]), ca.dot(along, b - edge[1]))


def _across_link(points: list, a: ca.SX, b: ca.SX) -> tuple[ca.SX, ca.SX]:
    """How far the polygon lies to the right and to the left of the line through the link."""
    normal = _right_of(b - a)
    # A link of length 0 has no sides.
    none = ca.if_else(ca.sumsqr(b - a) > _POINT, 0.0, _FAR)
    right = [ca.dot(normal, point - a) for point in points]
    return reduce(ca.fmin, right) - none, -reduce(ca.fmax, right) - none


def _right_of(along: ca.SX) -> ca.SX:
    return ca.vertcat(along[1], -along[0]) / ca.sqrt(ca.sumsqr(along) + _POINT)
