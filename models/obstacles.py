"""Round obstacles, and how far the links of an arm are from them."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import at_least, vector
from models.arm import PlanarArm
from ocp import ProblemError

# Added under the root [m^2]: at distance 0 the gradient is then 0 instead of NaN, and
# a distance of 1 mm changes by 5e-16 m.
_ROOT = 1e-18
# Added to the squared length of a segment [m^2]: one of length 0 is then a point.
_POINT = 1e-30


@dataclass(frozen=True, eq=False)
class Disc:
    """A disc that the arm should not touch.

    Args:
        center: (2,) [m], numbers, or an ``SX`` expression in time and parameters of the
            problem (a moving obstacle, an obstacle known only at run time).
        radius: d_b [m], positive.

    Raises:
        ProblemError: on a wrong size, NaN, or a radius that is not positive.
    """

    center: ca.SX | ArrayLike
    radius: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not isinstance(self.center, ca.SX):
            object.__setattr__(self, "center", vector(self.center, 2, "disc: center"))
        elif self.center.shape != (2, 1):
            raise ProblemError(f"disc: center has shape {self.center.shape}, (2, 1) is needed")
        radius = at_least(self.radius, 0.0, "disc: radius", strictly=True)
        object.__setattr__(self, "radius", radius)

    @property
    def position(self) -> ca.SX | ca.DM:
        """The centre (2,) [m], for casadi."""
        center = self.center
        return center if isinstance(center, ca.SX) else ca.DM(np.asarray(center, float))


def distance_to_segment(point: ca.SX | ca.DM, a: ca.SX, b: ca.SX) -> ca.SX:
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


def link_distances(arm: PlanarArm, theta: ca.SX | ArrayLike, disc: Disc) -> ca.SX:
    """Return the distance from the *centre* of a disc to each link (n,) [m]."""
    joints, center = arm.joints(theta), disc.position
    return ca.vertcat(
        *[distance_to_segment(center, joints[:, i], joints[:, i + 1]) for i in range(arm.n)]
    )
