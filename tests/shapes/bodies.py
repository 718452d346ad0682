"""Shapes to be compared, poses, and the same shapes for coal."""

# coal has no stubs, its names are made at import:
# pyright: reportAttributeAccessIssue=false

from functools import cache
from itertools import combinations_with_replacement

import casadi as ca
import coal
import numpy as np
from scipy.spatial.transform import Rotation

from models.shapes import Capsule, ConvexHull, Cuboid, Shape, Sphere, distance

_CORNERS = np.random.default_rng(5).normal(size=(8, 3)) * 0.4
SHAPES: dict[str, Shape] = {
    "ball": Sphere(0.15),
    "point": Sphere(0.0),
    "capsule": Capsule([0.0, 0.0, -0.4], [0.0, 0.0, 0.4], 0.1),
    "box": Cuboid([0.6, 0.8, 1.0]),
    "rounded box": Cuboid([0.3, 0.4, 0.5], 0.05),
    "hull": ConvexHull.around(_CORNERS),
}
PAIRS = list(combinations_with_replacement(SHAPES, 2))
# Finer than coal's default of 1e-6.
_TOLERANCE, _STEPS = 1e-13, 1000


def rotation_of(vector: ca.SX) -> ca.SX:
    """The rotation of a vector (4,), a quaternion of any length, its last entry the scalar."""
    x, y, z, w = ca.vertsplit(vector / ca.norm_2(vector))
    rows = [
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    ]
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])


@cache
def derivatives(first: str, second: str) -> ca.Function:
    """(both poses, (14,)) -> distance, gradient, Hessian."""
    z = ca.SX.sym("z", 14)
    d = distance(
        SHAPES[first].at(z[:3], rotation_of(z[3:7])),
        SHAPES[second].at(z[7:10], rotation_of(z[10:])),
    )
    hessian, gradient = ca.hessian(d, z)
    return ca.Function("distance", [z], [d, gradient, hessian])


def poses(rng: np.random.Generator, number: int, size: float = 1.0) -> np.ndarray:
    """Random poses of two bodies (number, 14)."""
    turns = [Rotation.random(number, rng=rng).as_quat() for _ in range(2)]
    places = rng.normal(size=(2, number, 3)) * size
    return np.hstack([places[0], turns[0], places[1], turns[1]])


def by_coal(first: Shape, second: Shape, pose: np.ndarray) -> float:
    """The signed distance that coal finds."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.gjk_tolerance = request.epa_tolerance = _TOLERANCE
    request.gjk_max_iterations = request.epa_max_iterations = _STEPS
    request.enable_signed_distance = True
    transforms = [
        coal.Transform3s(Rotation.from_quat(part[3:]).as_matrix(), part[:3])
        for part in (pose[:7], pose[7:])
    ]
    bodies = [coal_shape(first), coal_shape(second)]
    return coal.distance(bodies[0], transforms[0], bodies[1], transforms[1], request, result)


def coal_shape(shape: Shape) -> coal.CollisionGeometry:
    """The same shape for coal."""
    match shape:
        case Sphere():
            found = coal.Sphere(shape.radius)
        case Capsule():
            length = np.linalg.norm(np.asarray(shape.end) - np.asarray(shape.start))
            found = coal.Capsule(shape.radius, float(length))
        case Cuboid():
            found = coal.Box(*np.asarray(shape.size))
            found.setSweptSphereRadius(shape.radius)
        case ConvexHull():
            points = coal.StdVec_Vec3s()
            for vertex in np.asarray(shape.vertices):
                points.append(vertex)
            found = coal.Convex.convexHull(points, False, None)
            found.setSweptSphereRadius(shape.radius)
        case _:
            raise AssertionError(f"{shape.kind} is none of coal's")
    return found


def numeric(shape: Shape, other: Shape) -> float:
    """The distance of shapes whose poses are numbers."""
    return float(ca.evalf(distance(shape, other)))
