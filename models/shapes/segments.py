"""Where two segments, or a point and a segment, are nearest."""

from typing import NamedTuple

import casadi as ca

from models.shapes.gap import PARALLEL, TINY, Gap, clamped


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


def places_on_segments(
    uu: ca.SX, uv: ca.SX, vv: ca.SX, ur: ca.SX, vr: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return s and t where p + s u and q + t v are nearest, and whether u and v cross.

    From the products of u, v, neither zero, and r = q - p: s on the whole lines, cut to [0, 1];
    t for it, cut; s for that, cut [Ericson 2005, 5.1.9]. Of parallel segments one of the nearest
    pairs is taken: where they are not quite parallel, from the end of the first at which the lines
    approach each other.
    """
    across = uu * vv - uv**2
    crosses = across > PARALLEL * uu * vv
    towards = ur * vv - vr * uv
    s = clamped(crosses * towards / (across + TINY)) + (crosses < (towards > 0.0))
    t = clamped((uv * s - vr) / vv)
    return clamped((ur + uv * t) / uu), t, crosses


def nearest_on_segments(uu: ca.SX, uv: ca.SX, vv: ca.SX, ur: ca.SX, vr: ca.SX) -> Nearest:
    """Return what ``places_on_segments`` does, and where the distance is stationary."""
    s, t, crosses = places_on_segments(uu, uv, vv, ur, vr)
    s_free = ca.logic_and(s > 0.0, s < 1.0)
    t_free = ca.logic_and(ca.logic_and(t > 0.0, t < 1.0), ca.logic_or(crosses, 1.0 - s_free))
    return Nearest(s, t, s_free, t_free)


def point_to_segment(point: ca.SX, start: ca.SX, end: ca.SX) -> Gap:
    """Return the gap from a point (3,) to a segment with a length [m]."""
    along, away = end - start, point - start
    share = clamped(ca.dot(away, along) / ca.sumsqr(along))
    none = ca.SX(3, 1)
    return Gap(share * along - away, none, none, ca.SX(0))


def segment_to_segment(first: ca.SX, second: ca.SX) -> Gap:
    """Return the gap from a segment to another, each as its ends (3, 2) [m]."""
    p, q = first[:, 0], second[:, 0]
    u, v, r = first[:, 1] - p, second[:, 1] - q, q - p
    s, t, _ = places_on_segments(
        ca.sumsqr(u), ca.dot(u, v), ca.sumsqr(v), ca.dot(u, r), ca.dot(v, r)
    )
    none = ca.SX(3, 1)
    return Gap(r + t * v - s * u, none, none, ca.SX(0))
