"""What being close to an obstacle costs."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Literal

import casadi as ca

from models.arm import PlanarArm
from models.obstacles import Obstacle, link_distances
from ocp import ProblemError
from ocp.internal import check_not_negative, check_positive

Combine = Literal["sum", "closest"]


@dataclass(frozen=True)
class DistanceCost:
    r"""The distance cost p0 of the thesis, zero beyond the distance of influence.

    .. math::

        p_0(d) = \frac{s}{3} \max\Bigl(0, \; d_m \frac{d_m - d}{d_m - d_b}\Bigr)^3

    d is the distance from the core of an obstacle (a disc's centre) to a link, d_b its
    radius. At the obstacle's edge the cost is s d_m³/3, inside it stays finite.

    Source: thesis (3.48), with the max(0, ·) that it leaves out.

    Args:
        gain: s, the collision avoidance gain, not negative.
        influence: d_m [m], larger than the radius of every obstacle.
        combine: ``"sum"`` over all links and obstacles, or for every obstacle only the
            ``"closest"`` link, which has a kink where another link becomes the closest.

    Raises:
        ProblemError: naming the number that is out of its range.
    """

    gain: float
    influence: float
    combine: Combine = "sum"

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_not_negative(self.gain, "distance cost: gain")
        check_positive(self.influence, "distance cost: influence")
        if self.combine not in ("sum", "closest"):
            raise ProblemError(
                f"distance cost: combine = {self.combine!r}, neither sum nor closest"
            )

    @property
    def smoothness(self) -> Literal[0, 1]:
        """1 (the distance to a segment is C1) or, for the closest link, 0 (a kink)."""
        return 1 if self.combine == "sum" else 0

    def at_distance(self, distance: ca.SX, radius: float) -> ca.SX:
        """Return p0, element by element.

        Args:
            distance: from the core of an obstacle (m,) [m].
            radius: d_b of the obstacle [m].

        Raises:
            ProblemError: if the influence ends inside the obstacle.
        """
        d_m = self.influence
        if not d_m > radius:
            raise ProblemError(
                f"distance cost: influence = {d_m} m must be larger than the radius {radius} m "
                "of the obstacle"
            )
        depth = ca.fmax(0.0, (d_m - distance) * (d_m / (d_m - radius)))
        return self.gain / 3.0 * depth * depth**2

    def of(self, arm: PlanarArm, theta: ca.SX, obstacles: Sequence[Obstacle]) -> ca.SX:
        """Return the cost of a configuration (n,) [rad] among obstacles, a scalar."""
        total = ca.SX(0)
        for obstacle in obstacles:
            distances = link_distances(arm, theta, obstacle)
            if self.combine == "closest":
                distances = reduce(ca.fmin, ca.vertsplit(distances))
            total += ca.sum1(self.at_distance(distances, obstacle.radius))
        return total
