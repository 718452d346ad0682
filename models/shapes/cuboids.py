"""Where a point or a segment is nearest to a box."""

from functools import cache, reduce

import casadi as ca

from models.shapes.gap import PARALLEL, TINY, Gap, clamped
from ocp.internal import piecewise_constant

_AXES = range(3)
# More than any slope [m^2].
_FAR = 1e30


def point_to_box(x: ca.SX, half: ca.DM) -> Gap:
    """Return the gap from a box to a point (3,) in the box's frame [m]; negative inside."""
    found = _point_choice()(ca.vertcat(x, half))
    corner, line, face, has_plane = ca.vertsplit(found, [0, 3, 6, 9, 10])
    return Gap(x - corner, line, face, has_plane)


def segment_to_box(start: ca.SX, end: ca.SX, half: ca.DM, *, signed: bool) -> Gap:
    """Return the gap from a box to a segment in the box's frame [m].

    Args:
        start: one end (3,) [m].
        end: the other end (3,) [m].
        half: half the lengths of the box's edges (3,) [m].
        signed: whether the depth of a segment that enters the box counts; else it is 0.
    """
    along = end - start
    found = _segment_choice(signed)(ca.vertcat(start, along, half))
    columns = ca.vertsplit(found, [0, 1, 4, 5, 8, 11, 14, 15])
    part, corner, free, edge, across, face, has_plane = columns
    line = free * along + edge
    return Gap(start + part * along - corner, line, face + ca.cross(along, across), has_plane)


@cache
def _point_choice() -> ca.Function:
    x, half = ca.SX.sym("x", 3), ca.SX.sym("half", 3)
    side = _side(x, half)
    count = ca.sumsqr(side)
    excess = ca.fabs(x) - half
    deepest = reduce(ca.fmax, ca.vertsplit(excess))
    inside = count == 0.0
    first = ca.vertcat(excess[0] >= deepest, excess[1] >= deepest, excess[2] >= deepest)
    first = ca.vertcat(first[0], first[1] * (1 - first[0]), first[2] * (1 - first[0]))
    first[2] = first[2] * (1 - first[1])
    side = ca.if_else(inside, first * ca.if_else(x < 0.0, -1.0, 1.0), side)
    is_face = ca.logic_or(inside, count == 1.0)
    line = (count == 2.0) * (1.0 - side**2)
    choice = ca.vertcat(side * half, line, is_face * side, is_face)
    return piecewise_constant("nearest_on_box", ca.vertcat(x, half), choice)


@cache
def _segment_choice(signed: bool) -> ca.Function:
    """(start, u, half) -> see ``segment_to_box``."""
    p, u, half = (ca.SX.sym(name, 3) for name in ("p", "u", "half"))
    part = _nearest_part(p, u, half)
    x = p + part * u
    side = _side(x, half)
    count = ca.sumsqr(side)
    within = ca.logic_and(part > 0.0, part < 1.0)
    corner = side * half
    on_edge = (count == 2.0) * (1.0 - side**2)
    crosses = ca.sumsqr(ca.cross(u, on_edge)) > PARALLEL * ca.sumsqr(u)
    plane = ca.logic_and(ca.logic_and(within, crosses), count == 2.0)
    normal = ca.cross(u, on_edge)
    turn = ca.if_else(ca.dot(normal, x - corner) < 0.0, -1.0, 1.0)
    is_face = count == 1.0
    choice = ca.vertcat(
        part,
        corner,
        ca.logic_and(within, count == 3.0),
        (1.0 - plane) * on_edge,
        plane * turn * on_edge,
        is_face * side,
        ca.logic_or(plane, is_face),
    )
    if signed:
        choice = ca.if_else(count == 0.0, _deepest(p, u, half), choice)
    name = "nearest_or_deepest_in_box" if signed else "nearest_to_box"
    return piecewise_constant(name, ca.vertcat(p, u, half), choice)


def _side(x: ca.SX, half: ca.SX) -> ca.SX:
    """Return on which side of the box a point lies along each axis: -1, 0 within, 1."""
    return (x > half) - (x < -half)


def _nearest_part(p: ca.SX, u: ca.SX, half: ca.SX) -> ca.SX:
    """Return λ in [0, 1] for which p + λ u is nearest to the box.

    The slope of the squared distance along the segment grows, linearly from one crossing of a
    plane of a face to the next. Its zero lies between the last of these places where it is not
    positive and the first where it is.
    """
    crossings = [(s * half[i] - p[i]) / (u[i] + TINY) for i in _AXES for s in (-1.0, 1.0)]
    places = [ca.SX(0), ca.SX(1), *map(clamped, crossings)]
    slopes = [_slope(p + at * u, u, half) for at in places]
    low, high, below, above = ca.SX(0), ca.SX(1), -_FAR, _FAR
    for at, slope in zip(places, slopes, strict=True):
        positive = slope > 0.0
        other = 1.0 - positive
        # What does not count for an end is moved beyond it.
        low, high = ca.fmax(low, at - positive), ca.fmin(high, at + other)
        below = ca.fmax(below, slope - _FAR * positive)
        above = ca.fmin(above, slope + _FAR * other)
    # Where the zero lies beyond the segment, both ends are that end of it.
    return low - below / (above - below) * (high - low)


def _slope(x: ca.SX, u: ca.SX, half: ca.SX) -> ca.SX:
    return ca.dot(u, x - ca.fmax(-half, ca.fmin(half, x)))


def _deepest(p: ca.SX, u: ca.SX, half: ca.SX) -> ca.SX:
    """Return the choice for a segment that enters the box: the least shift that parts them.

    Candidates are the normals of the faces, and what is normal to an edge and the segment.
    """
    q, zero = p + u, ca.SX.zeros(3)
    best, choice = -ca.inf, ca.SX.zeros(15)
    for i in _AXES:
        for sign in (1.0, -1.0):
            depth = ca.fmin(sign * p[i], sign * q[i]) - half[i]
            face = ca.SX.zeros(3)
            face[i] = sign
            at_end = sign * q[i] < sign * p[i]
            found = ca.vertcat(at_end, face * half, 0.0, zero, zero, face, 1.0)
            choice = ca.if_else(depth > best, found, choice)
            best = ca.fmax(best, depth)
        edge = ca.SX.zeros(3)
        edge[i] = 1.0
        n = ca.cross(u, edge)
        turn = ca.if_else(ca.dot(n, p) < 0.0, -1.0, 1.0)
        size = ca.sumsqr(n)
        reach = turn * ca.dot(n, p) - ca.dot(half, ca.fabs(n))
        depth = ca.if_else(size > PARALLEL * ca.sumsqr(u), reach / ca.sqrt(size + TINY), -ca.inf)
        corner = turn * half * ca.if_else(n < 0.0, -1.0, 1.0)
        found = ca.vertcat(0.0, corner, 0.0, zero, turn * edge, zero, 1.0)
        choice = ca.if_else(depth > best, found, choice)
        best = ca.fmax(best, depth)
    return choice
