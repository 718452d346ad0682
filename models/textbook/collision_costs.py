"""The dilemma of thesis 3.3: a bounded distance cost may be paid, an unbounded one breaks."""

from dataclasses import dataclass, replace

import casadi as ca

from models.distance_cost import DistanceCost
from models.obstacles import link_distances
from models.scenarios import ArmScenario
from ocp import OCP, Parameter
from ocp.internal import check_instance, check_positive

WEIGHT = "weight"


@dataclass(frozen=True)
class BarrierCost:
    r"""A distance cost without bound: infinite from the disc's edge inwards.

    .. math::

        p_0(d) = s \Bigl(\frac{1}{d - d_b} - \frac{1}{d_m - d_b}\Bigr)^2
        \quad \text{for } d_b < d < d_m

    Source: [Khatib 1986]; the kind of cost that thesis 3.3 calls diverging (figure 3.16, bottom
    left).

    Args:
        gain: s, positive.
        influence: d_m [m], where it begins.
    """

    gain: float
    influence: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_positive(self.gain, "barrier cost: gain")
        check_positive(self.influence, "barrier cost: influence")

    def at_distance(self, distance: ca.SX, radius: float) -> ca.SX:
        """Return p0 element by element; ``inf`` within the radius.

        Args:
            distance: from the centre of the disc (m,) [m].
            radius: d_b [m].
        """
        here = 1.0 / (distance - radius) - 1.0 / (self.influence - radius)
        outside = self.gain * ca.fmax(0.0, here) ** 2
        return ca.if_else(distance > radius, outside, ca.inf)


def bounded_ocp(scenario: ArmScenario, *, weight: float = 1.0) -> OCP:
    """Return the soft problem (3.37, 3.48) with k as a parameter called ``"weight"``.

    Args:
        scenario: the arm and its disc.
        weight: k unless a run says otherwise.
    """
    check_instance(scenario, ArmScenario, "bounded_ocp: scenario")
    bare, k = scenario.ocp(weight=0.0), ca.SX.sym("k")
    cost = DistanceCost(scenario.gain, scenario.influence)
    return replace(
        bare,
        name=f"{scenario.name} bounded",
        running_cost=bare.running_cost + k * cost.of(scenario.arm, bare.model.x, (scenario.disc,)),
        parameters=(Parameter(WEIGHT, k, weight),),
        smoothness=1,
    )


def unbounded_ocp(scenario: ArmScenario, *, gain: float = 1e-3) -> OCP:
    """Return the problem with a barrier instead: it has no value where a link is in the disc.

    Args:
        scenario: the arm and its disc.
        gain: s of the barrier [m²].
    """
    check_instance(scenario, ArmScenario, "unbounded_ocp: scenario")
    bare = scenario.ocp(weight=0.0)
    cost = BarrierCost(gain, scenario.influence)
    distances = link_distances(scenario.arm, bare.model.x, scenario.disc)
    return replace(
        bare,
        name=f"{scenario.name} unbounded",
        running_cost=bare.running_cost + ca.sum1(cost.at_distance(distances, scenario.radius)),
        smoothness=1,
    )
