"""Where a body is: a rotation and a position."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import checked_rotation, vector
from ocp import ProblemError
from ocp.internal import Portable

Coordinates = ca.SX | ArrayLike


@dataclass(frozen=True, eq=False)
class Pose(Portable):
    """A rotation and a position: a point y of the body is at R y + p.

    Args:
        rotation: R (3, 3), numbers or an ``SX`` expression; orthonormal with determinant 1. Of
            an expression that cannot be checked, and distances are wrong where it does not hold.
        position: p (3,) [m], numbers or an ``SX`` expression.

    Raises:
        ProblemError: on a wrong shape, NaN, or numbers that are no rotation.
    """

    rotation: Coordinates = field(default_factory=lambda: np.eye(3))
    position: Coordinates = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the numbers."""
        object.__setattr__(self, "rotation", _rotation(self.rotation))
        object.__setattr__(self, "position", coordinates(self.position, "pose: position"))

    @property
    def R(self) -> ca.SX:
        """The rotation (3, 3); its zeros are structural."""
        return _expression(self.rotation)

    @property
    def p(self) -> ca.SX:
        """The position (3,) [m]."""
        return _expression(self.position)

    @property
    def turns(self) -> bool:
        """Whether the rotation is an expression."""
        return not self.R.is_constant()

    def __matmul__(self, inner: "Pose") -> "Pose":
        """Return the pose of what has the pose ``inner`` in this body."""
        return Pose(_plain(ca.mtimes(self.R, inner.R)), _plain(ca.mtimes(self.R, inner.p) + self.p))

    def of(self, points: ca.SX | ca.DM) -> ca.SX:
        """Return where points (3, k) of the body are [m]."""
        return ca.mtimes(self.R, points) + ca.repmat(self.p, 1, points.shape[1])

    def seen_from(self, other: "Pose") -> tuple[ca.SX, ca.SX]:
        """Return rotation (3, 3) and position (3,) [m] of this body in the frame of another."""
        back = other.R.T
        return ca.mtimes(back, self.R), ca.mtimes(back, self.p - other.p)


def coordinates(value: Coordinates, what: str) -> ca.SX | np.ndarray:
    """Return three numbers, or an ``SX`` of three entries; a list may hold both.

    Raises:
        ProblemError: on a wrong size and on NaN.
    """
    if isinstance(value, list | tuple) and any(isinstance(entry, ca.SX) for entry in value):
        entries: list[Any] = list(value)
        value = ca.vertcat(*entries)
    if isinstance(value, ca.MX):
        raise ProblemError(f"{what} is an MX, numbers or an SX are needed")
    if not isinstance(value, ca.SX):
        return vector(value, 3, what)
    if value.shape != (3, 1):
        raise ProblemError(f"{what} has shape {value.shape}, (3, 1) is needed")
    return value


def _rotation(value: Coordinates) -> ca.SX | np.ndarray:
    what = "pose: rotation"
    if isinstance(value, ca.MX):
        raise ProblemError(f"{what} is an MX, numbers or an SX are needed")
    if not isinstance(value, ca.SX):
        return checked_rotation(value, what)
    if value.shape != (3, 3):
        raise ProblemError(f"{what} has shape {value.shape}, (3, 3) is needed")
    return value


def _expression(value: Coordinates) -> ca.SX:
    return value if isinstance(value, ca.SX) else ca.SX(ca.sparsify(ca.DM(np.asarray(value))))


def _plain(value: ca.SX) -> ca.SX | np.ndarray:
    """Return numbers as numbers."""
    if not value.is_constant():
        return ca.densify(value)
    numbers = np.array(ca.evalf(value))
    return numbers.ravel() if numbers.shape[1] == 1 else _nearest_rotation(numbers)


def _nearest_rotation(product: np.ndarray) -> np.ndarray:
    """Return a product of rotations without the rounding that many of them gather."""
    left, _, right = np.linalg.svd(product)
    return left @ right if np.abs(left @ right - product).max() > 1e-12 else product
