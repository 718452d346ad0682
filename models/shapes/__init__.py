"""Bodies in space and the distances between them."""

from models.shapes.clearance import clearance, clearances
from models.shapes.distances import distance, distance_smoothness, squared_core_distance
from models.shapes.pose import Pose
from models.shapes.shapes import Capsule, ConvexHull, Cuboid, HalfSpace, Rounded, Shape, Sphere

__all__ = [
    "Capsule",
    "ConvexHull",
    "Cuboid",
    "HalfSpace",
    "Pose",
    "Rounded",
    "Shape",
    "Sphere",
    "clearance",
    "clearances",
    "distance",
    "distance_smoothness",
    "squared_core_distance",
]
