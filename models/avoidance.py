"""Obstacles in a problem: are they what they should be, and what do they forbid?"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import vector
from models.arm import PlanarArm
from models.distance_cost import DistanceCost
from models.distances import signed_distance
from models.obstacles import Disc, Obstacle, link_distances
from models.sampling import sampled
from ocp import Constraint, Parameter, ProblemError, Signal
from ocp.internal import Portable, check_instance, check_not_negative, check_positive


def clearance_constraint(
    arm: PlanarArm, theta: ca.SX, obstacles: Sequence[Obstacle], clearance: ArrayLike
) -> Constraint:
    """Return the path constraint ``"clearance"``, d_i(θ) >= d for every link and obstacle.

    Args:
        arm: the arm.
        theta: its joint angles (n,) [rad].
        obstacles: from whose cores the links keep away.
        clearance: one distance for all, or one for each obstacle [m].
    """
    check_instance(arm, PlanarArm, "clearance: arm")
    least = np.broadcast_to(np.asarray(clearance, dtype=float).reshape(-1), len(obstacles))
    distances = [link_distances(arm, theta, obstacle) for obstacle in obstacles]
    return Constraint("clearance", ca.vertcat(*distances), lower=np.repeat(least, arm.n))


def check_avoidance(
    name: str,
    obstacles: Sequence[Obstacle],
    distance_cost: DistanceCost | None,
    clearance: ArrayLike | None,
) -> None:
    """Refuse what is no obstacle, obstacles that nothing avoids, and a clearance from nothing.

    Raises:
        ProblemError: in these cases, and where a clearance is not positive (from a disc) or
            negative (from another shape).
    """
    if isinstance(obstacles, Obstacle):
        kind = type(obstacles).__name__
        raise ProblemError(f"{name}: obstacles is a {kind}; put it into a tuple: ({kind}(...),)")
    for i, obstacle in enumerate(obstacles):
        check_instance(obstacle, Obstacle, f"{name}: obstacles[{i}]")
    if distance_cost is not None:
        check_instance(distance_cost, DistanceCost, f"{name}: distance_cost")
    if clearance is None:
        if obstacles and distance_cost is None:
            raise ProblemError(f"{name}: obstacles need a distance_cost or a clearance to matter")
        return
    if not obstacles:
        raise ProblemError(f"{name}: a clearance is asked for, but there are no obstacles")
    count = np.size(clearance)
    least = vector(clearance, 1 if count == 1 else len(obstacles), f"{name}: clearance")
    for obstacle, d in zip(obstacles, np.broadcast_to(least, len(obstacles)).tolist(), strict=True):
        check = check_positive if isinstance(obstacle, Disc) else check_not_negative
        check(d, f"{name}: clearance")


@dataclass(frozen=True, eq=False, kw_only=True)
class Surroundings(Portable):
    """Where the obstacles of a problem are from its start to its end.

    Args:
        arm: the arm among them.
        obstacles: at rest or moving.
        t: the symbol of time [s].
        horizon: duration [s].
        parameters: those that the obstacles may depend on, with their declared values.
        name: what messages call the problem.
    """

    arm: PlanarArm
    obstacles: Sequence[Obstacle]
    t: ca.SX
    horizon: float
    parameters: Sequence[Parameter | Signal]
    name: str

    def check(self, theta0: np.ndarray | None) -> None:
        """Refuse obstacles that no motion of the arm can avoid.

        Args:
            theta0: the start configuration (n,) [rad], ``None``: it is free.

        Raises:
            ProblemError: if an obstacle covers the base at any time, or a link at the start.
        """
        for i, obstacle in enumerate(self.obstacles):
            what = f"{self.name}: obstacles[{i}] ({type(obstacle).__name__})"
            self._refuse_covered_base(obstacle, what)
            if theta0 is not None:
                self._refuse_covered_start(obstacle, theta0, what)

    def _refuse_covered_base(self, obstacle: Obstacle, what: str) -> None:
        base = ca.SX(ca.DM(self.arm.base))
        distance = signed_distance(obstacle.core, base, base)
        times, values = sampled(distance, self.t, self.horizon, self.parameters, what)
        k = int(values.argmin())
        if not values[k, 0] >= obstacle.radius:
            raise ProblemError(f"{what} covers the base of the arm at t = {times[k]:.4g} s")

    def _refuse_covered_start(self, obstacle: Obstacle, theta0: np.ndarray, what: str) -> None:
        distances = ca.SX(link_distances(self.arm, ca.SX(ca.DM(theta0)), obstacle))
        _, values = sampled(distances, self.t, self.horizon, self.parameters, what)
        link = int(values[0].argmin())
        if not values[0, link] >= obstacle.radius:
            raise ProblemError(
                f"{what}: the start is inside it: link {link} is {values[0, link]:.4g} m from its "
                f"core, {obstacle.radius:g} m are needed"
            )
