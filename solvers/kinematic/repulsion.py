"""The method of repulsive velocity: away from an obstacle, faster the closer it is."""

from dataclasses import dataclass
from functools import reduce

import casadi as ca
import numpy as np

from ocp import ProblemError
from ocp.internal import Portable, check_instance, check_positive
from solvers.kinematic.task import Task, as_column


@dataclass(frozen=True)
class Repulsion(Portable):
    r"""How fast to move away from an obstacle at a distance d, and from where on.

    .. math::

        \alpha_v(d) = \Bigl(\frac{d_m}{d}\Bigr)^2 - 1 \; (d \le d_m), \quad 0 \text{ beyond};
        \qquad \alpha_h(d) = \tfrac12 \Bigl(1 + \cos \pi \frac{d - d_m}{d_i - d_m}\Bigr)
        \; (d_m \le d \le d_i)

    α_h is 1 below d_m and 0 beyond d_i. α_v would be infinite at d = 0; it stops at
    ``ceiling``, also for the negative distances inside a polygon.

    Source: thesis (3.13)-(3.16) and figure 3.3, whose formulas it does not give;
    [Maciejewski & Klein 1985].

    v0, d_m and d_i may be CasADi symbols, for tasks whose Jacobians and demands are compiled as
    functions of them; then their values are not checked.

    Args:
        v0: repulsive speed where α_v = 1, that is at d = d_m / √2 [m/s], positive.
        d_m: distance at which repulsion begins [m], positive.
        d_i: distance at which the homogeneous term begins [m], larger than d_m.
        ceiling: largest α_v, positive.

    Raises:
        ProblemError: naming the number that is out of its range.
    """

    v0: float | ca.SX
    d_m: float | ca.SX
    d_i: float | ca.SX
    ceiling: float = 100.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("v0", "d_m", "d_i", "ceiling"):
            value = getattr(self, name)
            if isinstance(value, ca.SX) and name != "ceiling":
                continue
            check_positive(value, f"repulsion: {name}")
        if not isinstance(self.d_i <= self.d_m, ca.SX) and self.d_i <= self.d_m:
            raise ProblemError(
                f"repulsion: d_i = {self.d_i} m must be larger than d_m = {self.d_m} m"
            )

    def velocity_gain(self, distance: ca.SX) -> ca.SX:
        """Return α_v, element by element."""
        least = self.d_m / np.sqrt(1.0 + self.ceiling)
        return (self.d_m / ca.fmax(least, ca.fmin(self.d_m, distance))) ** 2 - 1.0

    def homogeneous_gain(self, distance: ca.SX) -> ca.SX:
        """Return α_h, element by element."""
        share = (distance - self.d_m) / (self.d_i - self.d_m)
        return (1.0 + ca.cos(np.pi * ca.fmax(0.0, ca.fmin(1.0, share)))) / 2.0


def repel(name: str, *, q: ca.SX, t: ca.SX, distance: ca.SX, repulsion: Repulsion) -> Task:
    r"""Return the task of keeping away from one obstacle.

    .. math:: \bar J_2 \dot q = \alpha_v v_0 - \frac{\partial d}{\partial t}, \qquad
              \bar J_2 = n_0' J_2 = \frac{\partial d}{\partial q}

    The gradient of the distance is n0'J2 with n0 pointing *away* from the obstacle, as it
    must for a positive speed to repel; the thesis has it towards. ∂d/∂t is what the obstacle
    moves by itself. A joint limit is an obstacle too: its distance is ``upper - q[i]``.

    Source: thesis (3.12)-(3.16).

    Args:
        name: what messages call it.
        q: joint angles (n,) [rad].
        t: time [s].
        distance: d(q, t) [m], of one point or of several, of which the closest counts.
        repulsion: α_v, α_h and v0.

    Raises:
        ProblemError: if the distance is no expression.
    """
    check_instance(repulsion, Repulsion, f"task '{name}': repulsion")
    distances = as_column(distance, f"task '{name}': distance")
    d = reduce(ca.fmin, ca.vertsplit(distances))
    return Task(
        name=name,
        q=q,
        t=t,
        value=d,
        rate=repulsion.v0 * repulsion.velocity_gain(d),
        activation=repulsion.homogeneous_gain(d),
    )
