"""What a robot carries: a mass that may be known only when a problem is solved."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import checked_tensor, vector
from models.robot.description import Pose
from models.robot.tree import homogeneous
from ocp import ProblemError
from ocp.internal import Portable, check_instance, check_not_negative


@dataclass(frozen=True, eq=False)
class Payload(Portable):
    """A rigid part fixed to a link.

    Args:
        frame: name of the link.
        mass: [kg], a number of 0 or more, or an expression such as the symbol of a ``Parameter``.
        center: its centre of mass (3,) [m] in the frame of the link, numbers or an expression.
        tensor: its moments of inertia (3, 3) [kg m^2] about its centre of mass, in the axes of
            the link; 0: a point mass.

    Raises:
        ProblemError: if a number is wrong, or the tensor is not symmetric or has a moment below 0.
    """

    frame: str
    mass: float | ca.SX
    center: ArrayLike | ca.SX = (0.0, 0.0, 0.0)
    tensor: ArrayLike = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_instance(self.frame, str, "payload: frame")
        what = f"payload at '{self.frame}'"
        if isinstance(self.mass, ca.SX):
            if self.mass.numel() != 1:
                raise ProblemError(f"{what}: its mass has {self.mass.numel()} entries, not one")
        else:
            check_not_negative(self.mass, f"{what}: mass")
        if isinstance(self.center, ca.SX):
            if self.center.numel() != 3:
                raise ProblemError(f"{what}: its center has {self.center.numel()} entries, not 3")
        else:
            vector(self.center, 3, f"{what}: center")
        is_point = np.ndim(self.tensor) == 0 and self.tensor == 0.0
        tensor = np.zeros((3, 3)) if is_point else self.tensor
        object.__setattr__(self, "tensor", checked_tensor(tensor, what))

    @property
    def symbols(self) -> ca.SX:
        """What is not known yet (k,)."""
        return ca.vertcat(ca.SX(0, 1), *ca.symvar(ca.veccat(ca.SX(self.mass), self._center)))

    @property
    def _center(self) -> ca.SX:
        given = self.center
        return ca.vec(given) if isinstance(given, ca.SX) else ca.SX(np.ravel(given))

    def pseudo_inertia(self, pose: Pose) -> ca.SX:
        """Return it (4, 4) in the frame of the body in which the link has this pose."""
        c = self._center
        h = self.mass * c
        tensor = np.asarray(self.tensor)
        about_center = ca.SX(np.trace(tensor) / 2.0 * np.eye(3) - tensor)
        second = about_center + ca.mtimes(h, c.T)
        own = ca.vertcat(ca.horzcat(second, h), ca.horzcat(h.T, ca.SX(self.mass)))
        place = ca.SX(homogeneous(pose))
        return ca.mtimes([place, own, place.T])
