"""What a posture costs by itself: close to joint limits, close to a singularity."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import vector
from models.arm import PlanarArm
from models.robot.robot import Robot
from ocp import ProblemError
from ocp.internal import check_instance, check_not_negative, check_positive


class PostureCost(ABC):
    """A running cost of the joint angles alone, as thesis (1.1) has room for.

    Attributes:
        smoothness: as an ``OCP`` declares it.
    """

    smoothness: ClassVar[Literal[0, 1, 2]] = 2

    @abstractmethod
    def of(self, arm: PlanarArm | Robot, theta: ca.SX) -> ca.SX:
        """Return the cost of a configuration (n,) [rad], a scalar."""


@dataclass(frozen=True, eq=False)
class JointLimitCost(PostureCost):
    r"""The distance from the middle of the joints' ranges.

    .. math:: s \, \frac{1}{n} \sum_i \Bigl(
              \frac{\theta_i - (l_i + u_i)/2}{u_i - l_i} \Bigr)^2

    It pulls towards the middle everywhere, s/4 where every joint is at a limit, and
    forbids nothing: that is what ``joint_bounds`` are for. Source: [Liegeois 1977].

    Args:
        gain: s, not negative.
        lower: l [rad], a number or (n,).
        upper: u [rad], a number or (n,), above ``lower``.

    Raises:
        ProblemError: on numbers out of range; from ``of``, on a wrong number of joints.
    """

    gain: float
    lower: ArrayLike
    upper: ArrayLike

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_not_negative(self.gain, "joint limit cost: gain")
        for name in ("lower", "upper"):
            values = getattr(self, name)
            what = f"joint limit cost: {name}"
            object.__setattr__(self, name, vector(values, np.size(values), what))
        lower, upper = np.asarray(self.lower), np.asarray(self.upper)
        if lower.size != upper.size or not (lower < upper).all():
            raise ProblemError(
                f"joint limit cost: lower = {lower}, upper = {upper}: every upper limit must be "
                "above its lower one"
            )

    def of(self, arm: PlanarArm | Robot, theta: ca.SX) -> ca.SX:
        """Return the cost of a configuration (n,) [rad]."""
        lower, upper = np.asarray(self.lower), np.asarray(self.upper)
        if lower.size not in (1, arm.n):
            raise ProblemError(f"joint limit cost: {lower.size} limits, the arm has {arm.n} joints")
        share = (theta - ca.DM((lower + upper) / 2.0)) / ca.DM(upper - lower)
        return self.gain / arm.n * ca.sumsqr(share)


@dataclass(frozen=True, eq=False)
class ManipulabilityCost(PostureCost):
    r"""The nearness of a singular configuration, zero where the arm is dexterous.

    .. math:: \frac{s}{3} \max\Bigl(0, \; 1 - \frac{w^2}{w_m^2} \Bigr)^3, \qquad
              w = \sqrt{\det(J J')}

    At a singularity (w = 0) it is s/3, its greatest value, and its gradient is zero: a
    singular configuration is left by whatever breaks the symmetry. Source: the measure is
    that of [Yoshikawa 1985], the form that of the distance cost (3.48).

    Args:
        gain: s, not negative.
        influence: w_m [m²], positive; beyond it nothing is charged.

    Raises:
        ProblemError: on numbers out of range.
    """

    gain: float
    influence: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_not_negative(self.gain, "manipulability cost: gain")
        check_positive(self.influence, "manipulability cost: influence")

    def of(self, arm: PlanarArm | Robot, theta: ca.SX) -> ca.SX:
        """Return the cost of a configuration (n,) [rad]."""
        if isinstance(arm, Robot):
            raise ProblemError("manipulability cost: it is that of a PlanarArm, not of a Robot")
        lack = ca.fmax(0.0, 1.0 - squared_manipulability(arm, theta) / self.influence**2)
        return self.gain / 3.0 * lack * lack**2


def squared_manipulability(arm: PlanarArm, theta: ca.SX) -> ca.SX:
    """Return w² = det(JJ') [m⁴], zero at a singularity, smooth everywhere.

    Args:
        arm: the arm, n links.
        theta: configuration (n,) [rad].
    """
    check_instance(arm, PlanarArm, "squared manipulability: arm")
    jacobian = arm.jacobian(theta)
    first, second = jacobian[0, :], jacobian[1, :]
    return ca.sumsqr(first) * ca.sumsqr(second) - ca.dot(first, second) ** 2
