"""Seven links, three discs, joint limits: a scenario in which all of it matters."""

from models.arm import PlanarArm
from models.distance_cost import DistanceCost
from models.obstacles import Disc
from models.paths import line
from models.redundancy import redundancy_ocp
from ocp import OCP, Box

ARM = PlanarArm((0.5,) * 7)
# Bent over the discs like a crane [rad].
THETA0 = (2.2, -0.55, -0.55, -0.55, -0.45, -0.45, -0.35)
VELOCITY = (0.5, -0.5)  # of the end effector [m/s]
HORIZON = 1.5  # [s]
# Their centres are 0.08 to 0.09 m from links 3, 5 and 7 of the unhindered end configuration.
DISCS = (Disc((0.44, 0.94), 0.06), Disc((1.36, 0.99), 0.06), Disc((2.17, 0.52), 0.06))
# With a clearance of 0.095 m alone the third joint would turn to -0.58 [rad].
LIMITS = Box([1.4, -1.2, -0.57, -1.2, -1.2, -1.2, -1.2], [2.6, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3])


def seven_links(
    *, gain: float = 0.0, clearance: float | None = 0.095, joint_bounds: Box | None = LIMITS
) -> OCP:
    """Return the problem; the end effector goes down a slope over the discs.

    Args:
        gain: of the soft distance cost (3.48), with an influence of 0.5 m; 0: effort only.
        clearance: every link keeps this distance from every centre [m]; ``None``: no matter.
        joint_bounds: limits of the joints [rad]; ``None``: none.
    """
    start = ARM.positions(THETA0)[0, -1]
    return redundancy_ocp(
        ARM,
        line(start, VELOCITY),
        theta0=THETA0,
        horizon=HORIZON,
        obstacles=DISCS,
        distance_cost=DistanceCost(gain, 0.5),
        clearance=clearance,
        joint_bounds=joint_bounds,
        name="seven links",
    )
