"""Where two segments, or a point and a segment, are nearest."""

from functools import cache
from typing import NamedTuple

import casadi as ca

from models.shapes.gap import PARALLEL, TINY, Gap, clamped, piecewise_constant


class Nearest(NamedTuple):
    """Where two segments p + s u and q + t v are nearest, s and t in [0, 1].

    Attributes:
        s: place on the first.
        t: place on the second.
        s_free: 1 if the distance is stationary in s, within the segment; else 0.
        t_free: the same of t; not both where the segments are parallel.
    """

    s: ca.SX
    t: ca.SX
    s_free: ca.SX
    t_free: ca.SX


def nearest_on_segments(
    uu: ca.SX, uv: ca.SX, vv: ca.SX, ur: ca.SX, vr: ca.SX
) -> Nearest:
    """Return where two segments are nearest, from the products of u, v and r = q - p.

    In exact arithmetic: s on the whole lines, cut; t for it, cut; s for that, cut
    [Ericson 2005, 5.1.9]. Of parallel segments any of the nearest pairs is taken.
    """
    across = uu * vv - uv**2
    crosses = across > PARALLEL * uu * vv
    s = clamped(ca.if_else(crosses, (ur * vv - vr * uv) / (across + TINY), 0.0))
    t = clamped((uv * s - vr) / (vv + TINY))
    s = clamped((ur + uv * t) / (uu + TINY))
    s_free = ca.logic_and(s > 0.0, s < 1.0)
    t_free = ca.logic_and(ca.logic_and(t > 0.0, t < 1.0), ca.logic_or(crosses, 1.0 - s_free))
    return Nearest(s, t, s_free, t_free)


def point_to_segment(point: ca.SX, start: ca.SX, end: ca.SX) -> Gap:
    """Return the gap from a point (3,) to a segment [m]."""
    along = end - start
    share = clamped(ca.dot(point - start, along) / (ca.sumsqr(along) + TINY))
    none = ca.SX(3, 1)
    return Gap(start + share * along - point, none, none, ca.SX(0))


def segment_to_segment(first: ca.SX, second: ca.SX) -> Gap:
    """Return the gap from a segment to another, each as its ends (3, 2) [m]."""
    p, q = first[:, 0], second[:, 0]
    u, v, r = first[:, 1] - p, second[:, 1] - q, q - p
    n = ca.cross(u, v)
    products = [ca.sumsqr(u), ca.dot(u, v), ca.sumsqr(v), ca.dot(u, r), ca.dot(v, r)]
    s, t, line_u, line_v, side = _choice()(*products, ca.dot(n, r))
    w = r + t * v - s * u
    return Gap(w, line_u * u + line_v * v, side * n, side**2)


@cache
def _choice() -> ca.Function:
    """(products of u, v, r; (u x v)'r) -> s, t, the part of u and v in a line, the plane's side."""
    names = ["uu", "uv", "vv", "ur", "vr", "nr"]
    given = [ca.SX.sym(name) for name in names]
    s, t, s_free, t_free = nearest_on_segments(*given[:-1])
    both = ca.logic_and(s_free, t_free)
    side = both * ca.if_else(given[-1] < 0.0, -1.0, 1.0)
    outputs = [s, t, s_free - both, t_free - both, side]
    found = ["s", "t", "line_u", "line_v", "side"]
    return piecewise_constant("nearest_on_segments", given, outputs, (names, found))
