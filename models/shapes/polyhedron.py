"""Vertices, edges and faces of a convex body that is given by points."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull as QHull
from scipy.spatial import QhullError

from models._numbers import checked_matrix
from ocp import ProblemError

# Faces whose normals and offsets agree to this, relative to the size, are one; a body that is
# thinner than this has no inside.
_FLAT = 1e-9


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """A point, a segment or a convex body with an inside, in its own frame.

    Attributes:
        vertices: (k, 3) [m].
        edges: vertex numbers of both ends (e, 2); a point has one edge of length zero.
        triangles: vertex numbers of the triangles of its surface (f, 3).
        normals: of the triangles, outwards (f, 3).
    """

    vertices: np.ndarray
    edges: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray

    @classmethod
    def segment(cls, start: ArrayLike, end: ArrayLike) -> "Polyhedron":
        """Return the segment between two points; equal ones are a point."""
        none = np.zeros((0, 3))
        edges = np.array([[0, 1]])
        return cls(np.array([start, end], dtype=float), edges, none.astype(int), none)

    @classmethod
    def hull(cls, points: np.ndarray) -> "Polyhedron":
        """Return the smallest convex body around points (k, 3), checked by ``checked_points``."""
        found = QHull(points)
        kept = np.sort(found.vertices)
        number = np.full(len(points), -1)
        number[kept] = np.arange(len(kept))
        triangles = number[found.simplices]
        normals = found.equations[:, :3]
        return cls(points[kept], _edges(triangles, normals), triangles, normals)

    def __eq__(self, other: object) -> bool:
        """Whether the other has the same vertices, in the same order."""
        return isinstance(other, Polyhedron) and np.array_equal(self.vertices, other.vertices)

    def __hash__(self) -> int:
        return hash(self.vertices.tobytes())

    @property
    def directions(self) -> np.ndarray:
        """Unit vectors along its edges, each once, (d, 3)."""
        along = self.vertices[self.edges[:, 1]] - self.vertices[self.edges[:, 0]]
        lengths = np.linalg.norm(along, axis=1, keepdims=True)
        along = (along / np.where(lengths > 0.0, lengths, 1.0))[lengths.ravel() > 0.0]
        return _once(along, both_ways=True)

    @property
    def planes(self) -> tuple[np.ndarray, np.ndarray]:
        """Normals (m, 3) of its faces, each once, and a point (m, 3) [m] of each face."""
        normals = _once(self.normals, both_ways=False)
        farthest = (self.vertices @ normals.T).argmax(axis=0)
        return normals, self.vertices[farthest]


def checked_points(points: ArrayLike, what: str) -> np.ndarray:
    """Return points (k, 3) [m] that have a convex hull with an inside.

    Raises:
        ProblemError: on a wrong shape, NaN, fewer than four points, and points in one plane.
    """
    found = checked_matrix(points, (None, 3), what)
    if len(found) < 4:
        raise ProblemError(f"{what} are {len(found)}, at least 4 are needed; take a Capsule")
    away = found - found.mean(axis=0)
    size = np.linalg.svd(away, compute_uv=False)
    if size[2] <= _FLAT * size[0]:
        raise ProblemError(
            f"{what} lie in one plane: a hull needs an inside; move some of them by a thickness, "
            "or take a Capsule"
        )
    return found


def inner_points(points: np.ndarray) -> np.ndarray:
    """Return the numbers of the points that are no corners of their hull, repeated ones too."""
    try:
        corners = QHull(points).vertices
    except QhullError as error:
        raise ProblemError(f"hull: its vertices have no convex hull: {error}") from error
    return np.setdiff1d(np.arange(len(points)), corners)


def _edges(triangles: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the edges at which the surface bends, (e, 2)."""
    beside: dict[tuple[int, int], list[int]] = {}
    for face, corners in enumerate(triangles):
        for i, j in pairwise([*corners, corners[0]]):
            beside.setdefault((min(i, j), max(i, j)), []).append(face)
    bends = [
        edge
        for edge, faces in beside.items()
        if np.abs(normals[faces[0]] - normals[faces[-1]]).max() > _FLAT
    ]
    return np.array(sorted(bends))


def _once(vectors: np.ndarray, *, both_ways: bool) -> np.ndarray:
    """Return unit vectors without repetitions, opposite ones being the same if ``both_ways``."""
    kept: list[np.ndarray] = []
    for each in vectors:
        signs = (1.0, -1.0) if both_ways else (1.0,)
        if all(np.abs(each - s * k).max() > _FLAT for k in kept for s in signs):
            kept.append(each)
    return np.array(kept).reshape(-1, 3)
