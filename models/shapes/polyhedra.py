"""Where two polyhedra are nearest, or how deep one is in the other.

All pairs of edges, and of vertices and faces, are compared. The nearest pair is right if all of
both bodies lies beyond the planes through its points; else the bodies overlap, and of all normals
of faces, and of edges of both, the one with the least overlap counts. Both are loops over constant
tables in a call node, which evaluates the second only where it is needed.
"""

from collections.abc import Callable
from functools import lru_cache

import casadi as ca
import numpy as np

from models.shapes.gap import PARALLEL, TINY, Gap
from models.shapes.polyhedron import Polyhedron
from models.shapes.segments import nearest_on_segments
from ocp.internal import piecewise_constant

# The columns of a choice: points of both bodies, each in its own frame, the normal of a face, the
# directions of crossing edges, the directions of a line, and whether there is a plane.
_SIZES = (3, 3, 3, 3, 3, 3, 3, 3, 1)
_NAMES = ["a", "b", "face_a", "face_b", "cross_a", "cross_b", "line_a", "line_b", "has_plane"]
_FAR = 1e300
# A face contains the foot of a vertex up to this, relative to the size of the face.
_INSIDE = 1e-12
# The planes through the nearest points are as far apart as these, or not at all where the bodies
# overlap. Half of it tells the cases apart, whatever rounding does.
_CERTAIN = 0.5


def polyhedron_to_polyhedron(choice: ca.Function, rotation: ca.SX, shift: ca.SX) -> Gap:
    """Return the gap from a polyhedron to another, negative where they overlap.

    Args:
        choice: of the two, see ``nearest_features``.
        rotation: of the second in the frame of the first (3, 3).
        shift: where its origin is there (3,) [m].
    """
    found = choice(ca.densify(ca.vertcat(ca.vec(rotation), shift)))
    columns = ca.vertsplit(found, np.cumsum([0, *_SIZES]).tolist())
    a, b, face_a, face_b, cross_a, cross_b, line_a, line_b, has_plane = columns

    def turned(each: ca.SX) -> ca.SX:
        return ca.mtimes(rotation, each)

    return Gap(
        turned(b) + shift - a,
        line_a + turned(line_b),
        face_a + turned(face_b) + ca.cross(cross_a, turned(cross_b)),
        has_plane,
    )


# Many links and obstacles have one form: their node is made once.
@lru_cache(maxsize=64)
def nearest_features(first: Polyhedron, second: Polyhedron) -> ca.Function:
    """Return the call node (rotation and shift of the second, (12,)) -> features of both."""
    pose = ca.MX.sym("pose", 12)
    apart = [_edges(first, second, pose)]
    for one, other, swapped in ((first, second, False), (second, first, True)):
        if len(one.triangles):
            apart.append(_vertices(one, other, swapped, pose))
    choice = _least(apart)
    if len(first.triangles) or len(second.triangles):
        choice = _certain_or_deepest(first, second, pose, choice)
    return piecewise_constant("nearest_features", pose, choice)


class _Place:
    """The pose of the second body in the frame of the first, from one column (12,)."""

    def __init__(self, pose: ca.SX) -> None:
        self.R = ca.reshape(pose[:9], 3, 3)
        self.p = pose[9:]

    def of(self, point: ca.SX) -> ca.SX:
        return ca.mtimes(self.R, point) + self.p

    def back(self, point: ca.SX) -> ca.SX:
        return ca.mtimes(self.R.T, point - self.p)


Candidate = Callable[[_Place, ca.SX], tuple[ca.SX, ca.SX]]


def _best(candidate: Candidate, table: np.ndarray, pose: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Return the least key among the columns of a table, and its choice."""
    column, where = ca.SX.sym("column", table.shape[0]), ca.SX.sym("pose", 12)
    key, choice = candidate(_Place(where), column)
    best, number = ca.SX.sym("best", 2), ca.SX.sym("number")
    is_better = key < best[0]
    kept = ca.if_else(is_better, ca.vertcat(key, number), best)
    count = table.shape[1]
    step = ca.Function("step", [best, where, column, number], [kept]).fold(count)
    numbers = ca.DM(np.arange(count)).T
    given = ca.DM(table)
    found = step(ca.DM([_FAR, 0.0]), ca.repmat(pose, 1, count), given, numbers)
    make = ca.Function("make", [where, column], [choice])
    return found[0], make(pose, ca.MX(given)[:, found[1]])


def _least(candidates: list[tuple[ca.MX, ca.MX]]) -> ca.MX:
    key, choice = candidates[0]
    for other, its_choice in candidates[1:]:
        choice = ca.if_else(other < key, its_choice, choice)
        key = ca.fmin(other, key)
    return choice


def _choice(**parts: ca.SX) -> ca.SX:
    """Return the column of a choice; what is not named is zero."""
    named = zip(_NAMES, _SIZES, strict=True)
    return ca.vertcat(*[ca.densify(parts.get(name, ca.SX(size, 1))) for name, size in named])


def _edges(first: Polyhedron, second: Polyhedron, pose: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Return squared distance and choice of the nearest edges."""
    ends = [
        np.hstack([b.vertices[b.edges[:, 0]], b.vertices[b.edges[:, 1]]]) for b in (first, second)
    ]
    table = np.array([np.hstack([one, other]) for one in ends[0] for other in ends[1]]).T

    def candidate(place: _Place, column: ca.SX) -> tuple[ca.SX, ca.SX]:
        p, p_end, q, q_end = ca.vertsplit(column, [0, 3, 6, 9, 12])
        u, v = p_end - p, q_end - q
        turned, r = ca.mtimes(place.R, v), place.of(q) - p
        s, t, s_free, t_free = nearest_on_segments(
            ca.sumsqr(u) + TINY,  # a point is an edge without length
            ca.dot(u, turned),
            ca.sumsqr(v) + TINY,
            ca.dot(u, r),
            ca.dot(turned, r),
        )
        w = r + t * turned - s * u
        both = s_free * t_free
        side = both * ca.if_else(ca.dot(ca.cross(u, turned), w) < 0.0, -1.0, 1.0)
        return ca.sumsqr(w), _choice(
            a=p + s * u,
            b=q + t * v,
            cross_a=side * u,
            cross_b=both * v,
            line_a=(s_free - both) * u,
            line_b=(t_free - both) * v,
            has_plane=both,
        )

    return _best(candidate, table, pose)


def _vertices(
    body: Polyhedron, other: Polyhedron, swapped: bool, pose: ca.MX
) -> tuple[ca.MX, ca.MX]:
    """Return squared distance and choice of a face and the vertex that is nearest above it.

    Args:
        body: that has the faces.
        other: that has the vertices.
        swapped: whether the body with the faces is the second.
        pose: of the second in the frame of the first.
    """
    faces = [
        np.hstack([body.vertices[corners].ravel(), normal])
        for corners, normal in zip(body.triangles, body.normals, strict=True)
    ]
    table = np.array([np.hstack([face, vertex]) for face in faces for vertex in other.vertices]).T

    def candidate(place: _Place, column: ca.SX) -> tuple[ca.SX, ca.SX]:
        *corners, n, vertex = ca.vertsplit(column, [0, 3, 6, 9, 12, 15])
        seen = place.back(vertex) if swapped else place.of(vertex)
        height = ca.dot(n, seen - corners[0])
        # Inside of a triangle the three parts that the foot cuts off turn the same way.
        parts = [
            ca.dot(n, ca.cross(corners[(i + 1) % 3] - corners[i], seen - corners[i]))
            for i in range(3)
        ]
        least = ca.fmin(ca.fmin(parts[0], parts[1]), parts[2])
        # They have the sign with which the corners go round.
        most = ca.fmax(ca.fmax(parts[0], parts[1]), parts[2])
        slack = _INSIDE * ca.fabs(parts[0] + parts[1] + parts[2])
        inside = ca.logic_or(least >= -slack, most <= slack)
        above = ca.logic_and(inside, height >= 0.0)
        foot = seen - height * n
        return ca.if_else(above, height**2, _FAR), _face_choice(foot, vertex, n, swapped)

    return _best(candidate, table, pose)


def _face_choice(on_face: ca.SX, vertex: ca.SX, n: ca.SX, swapped: bool) -> ca.SX:
    """Return the choice of a face with the normal n, outwards, and a vertex of the other body."""
    one = ca.SX(1)
    if swapped:
        return _choice(a=vertex, b=on_face, face_b=-n, has_plane=one)
    return _choice(a=on_face, b=vertex, face_a=n, has_plane=one)


def _certain_or_deepest(first: Polyhedron, second: Polyhedron, pose: ca.MX, choice: ca.MX) -> ca.MX:
    """Return the choice if planes part the bodies at its points; else the deepest one."""
    where, given = ca.SX.sym("pose", 12), ca.SX.sym("choice", sum(_SIZES))
    place = _Place(where)
    a, b = given[:3], place.of(given[3:6])
    w = b - a
    low, high = _reach(first, second, place, w)
    certain = low - high >= _CERTAIN * ca.sumsqr(w)
    is_certain = ca.Function(
        "is_certain", [where, given], [ca.logic_and(certain, ca.sumsqr(w) > 0)]
    )
    at, found = ca.MX.sym("pose", 12), ca.MX.sym("choice", sum(_SIZES))
    select = ca.Function.if_else(
        "certain_or_deepest",
        ca.Function("nearest", [at, found], [found]),
        ca.Function("deepest", [at, found], [_deepest(first, second, at)]),
    )
    return select(is_certain(pose, choice), pose, choice)


def _reach(first: Polyhedron, second: Polyhedron, place: _Place, n: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return how far the second begins, and how far the first ends, along n."""
    seen = ca.mtimes(place.R.T, n)
    low = ca.mmin(ca.mtimes(ca.DM(second.vertices), seen)) + ca.dot(n, place.p)
    return low, ca.mmax(ca.mtimes(ca.DM(first.vertices), n))


def _deepest(first: Polyhedron, second: Polyhedron, pose: ca.MX) -> ca.MX:
    """Return the choice with the least overlap: minus the gap along its normal is the least."""
    candidates = []
    for body, other, swapped in ((first, second, False), (second, first, True)):
        if len(body.triangles):
            table = np.hstack(body.planes).T
            candidates.append(_best(_overlap_of_face(other, swapped), table, pose))
    pairs = [np.hstack([u, v]) for u in first.directions for v in second.directions]
    if pairs:
        table = np.array([np.hstack([s * pair[:3], pair[3:]]) for pair in pairs for s in (1, -1)]).T
        candidates.append(_best(_overlap_across(first, second), table, pose))
    return _least(candidates)


def _overlap_of_face(other: Polyhedron, swapped: bool) -> Candidate:
    def candidate(place: _Place, column: ca.SX) -> tuple[ca.SX, ca.SX]:
        n, point = column[:3], column[3:]
        if swapped:  # in the frame of the second, which has the face
            direction = ca.mtimes(place.R, n)
            start = place.back(ca.SX.zeros(3))
        else:
            direction = ca.mtimes(place.R.T, n)
            start = place.p
        height, vertex = _lowest(other, direction)
        gap = height + ca.dot(n, start - point)
        return -gap, _face_choice(point, vertex, n, swapped)

    return candidate


def _overlap_across(first: Polyhedron, second: Polyhedron) -> Candidate:
    def candidate(place: _Place, column: ca.SX) -> tuple[ca.SX, ca.SX]:
        u, v = column[:3], column[3:]
        n = ca.cross(u, ca.mtimes(place.R, v))
        high, a = _lowest(first, -n)
        low, b = _lowest(second, ca.mtimes(place.R.T, n))
        gap = (low + ca.dot(n, place.p) + high) / ca.sqrt(ca.sumsqr(n) + TINY)
        chosen = _choice(a=a, b=b, cross_a=u, cross_b=v, has_plane=ca.SX(1))
        return ca.if_else(ca.sumsqr(n) > PARALLEL, -gap, _FAR), chosen

    return candidate


def _lowest(body: Polyhedron, n: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the least n'y over the vertices of a body, and that vertex."""
    low, vertex = ca.SX(_FAR), ca.SX.zeros(3)
    for each in body.vertices:
        height = ca.dot(n, ca.DM(each))
        vertex = ca.if_else(height < low, ca.DM(each), vertex)
        low = ca.fmin(low, height)
    return low, vertex
