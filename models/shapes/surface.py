"""The surface of a shape as triangles, to be drawn."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull as QHull

from models.shapes.shapes import HalfSpace, Rounded, Shape

# Directions in which a round shape is looked at: rings with the poles, the equator among them.
_RINGS, _AROUND = 11, 24
# Half the edge of the square that stands for a plane [m].
_PLANE = 1.5


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles in the frame of the shape.

    Attributes:
        points: corners (3 k, 3) [m], three a triangle, counter-clockwise from outside.
        normals: of the surface at them (3 k, 3), of length 1.
    """

    points: np.ndarray
    normals: np.ndarray


def surface(shape: Shape) -> Surface:
    """Return the surface of a shape; of a half-space a square of its plane."""
    if isinstance(shape, HalfSpace):
        return _square(shape)
    assert isinstance(shape, Rounded)  # shapes are of these two kinds
    core = np.unique(shape.core.vertices, axis=0)
    radius = shape.radius
    if radius == 0.0 and len(core) < 4:
        return Surface(np.empty((0, 3)), np.empty((0, 3)))
    out = _directions(core) if radius > 0.0 else np.zeros((1, 3))
    points = (core[:, None, :] + radius * out[None, :, :]).reshape(-1, 3)
    found = QHull(points)
    # The triangles of qhull have no orientation of their own: their planes have.
    corners = points[found.simplices]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = found.equations[:, :3]
    turned = np.einsum("ij,ij->i", across, flat) < 0.0
    order = np.where(turned[:, None], found.simplices[:, ::-1], found.simplices)
    normals = np.tile(out, (len(core), 1))[order] if radius > 0.0 else flat[:, None].repeat(3, 1)
    return Surface(points[order].reshape(-1, 3), normals.reshape(-1, 3))


def _directions(core: np.ndarray) -> np.ndarray:
    """Return unit vectors all over the sphere (k, 3), in rings round the direction of the core."""
    height, angle = np.meshgrid(
        np.linspace(-np.pi / 2.0, np.pi / 2.0, _RINGS),
        np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False),
    )
    ring = np.cos(height)
    sides = [ring * np.cos(angle), ring * np.sin(angle), np.sin(height)]
    found = np.stack(sides, axis=-1).reshape(-1, 3)
    axis = core[-1] - core[0] if len(core) == 2 else np.array([0.0, 0.0, 1.0])
    return np.unique(found.round(12), axis=0) @ _frame_along(axis).T


def _frame_along(axis: np.ndarray) -> np.ndarray:
    """Return a rotation (3, 3) whose third column is along an axis (3,)."""
    third = axis / np.linalg.norm(axis)
    first = np.cross(np.eye(3)[np.abs(third).argmin()], third)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(third, first), third])


def _square(shape: HalfSpace) -> Surface:
    first, second, normal = _frame_along(np.asarray(shape.normal)).T
    corners = [a * first + b * second for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    points = shape.offset * normal + _PLANE * np.array(corners)[[0, 1, 2, 0, 2, 3]]
    return Surface(points, np.tile(normal, (6, 1)))
