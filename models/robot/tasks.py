"""What a frame of a robot is to do in space: be somewhere, be turned some way, or both."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import checked_matrix, checked_rotation, returned_expression, vector
from models.robot.orientation import rotation_error
from models.robot.robot import Robot
from ocp import ProblemError
from ocp.internal import check_instance

# From time t [s], an SX, to a position (3,) [m] or a rotation (3, 3).
InTime: TypeAlias = Callable[[ca.SX], Any]


class SpaceTask(ABC):
    r"""What a frame is to do, as an error that is zero where it does it.

    Of the error e(q, t) a task knows J and w with

    .. math:: J(q, t) \, \dot q = w(t) - k e \quad \Rightarrow \quad \dot e = -k e

    for every k: where e = 0, J is its derivative in q.
    """

    frame: str

    @abstractmethod
    def error(self, robot: Robot, q: ca.SX, t: ca.SX) -> ca.SX:
        """Return the error (m,) at q (n,) and t [s]."""

    @abstractmethod
    def jacobian(self, robot: Robot, q: ca.SX, t: ca.SX) -> ca.SX:
        """Return J (m, n)."""

    @abstractmethod
    def rate(self, t: ca.SX) -> ca.SX:
        """Return w (m,)."""

    def place(self, t: ca.SX) -> ca.SX | None:
        """Return where the frame has to be (3,) [m]; None: the task does not say."""
        return None


@dataclass(frozen=True, eq=False)
class PositionTask(SpaceTask):
    """The origin of a frame follows a path, in all directions or in some.

    Args:
        frame: name of the frame.
        path: p_d (3,) [m], numbers, or a function of the symbol of time.
        directions: rows (m, 3) in the axes of the base: only the error along them counts. Two at
            right angles to a line leave the frame free along it. None: all three.

    Raises:
        ProblemError: on shapes that do not fit, or directions that depend on each other.
    """

    frame: str
    path: ArrayLike | InTime
    directions: ArrayLike | None = None

    def __post_init__(self) -> None:
        """Check frame and directions."""
        check_instance(self.frame, str, "position task: frame")
        if not callable(self.path):
            vector(self.path, 3, self._what)
        if self.directions is None:
            return
        what = f"position task of '{self.frame}': directions"
        matrix = checked_matrix(self.directions, (None, 3), what)
        if np.linalg.matrix_rank(matrix) < len(matrix):
            raise ProblemError(f"{what} depend on each other: {matrix.tolist()}")
        object.__setattr__(self, "directions", matrix)

    def error(self, robot: Robot, q: ca.SX, t: ca.SX) -> ca.SX:
        """Return p(q) - p_d(t), along the directions (m,) [m]."""
        return self._along(robot.position(q, self.frame) - self._target(t))

    def jacobian(self, robot: Robot, q: ca.SX, t: ca.SX) -> ca.SX:
        """Return that of the position, along the directions (m, n)."""
        return self._along(robot.jacobian(q, self.frame)[:3, :])

    def rate(self, t: ca.SX) -> ca.SX:
        """Return the velocity of p_d along the directions (m,) [m/s]."""
        return self._along(ca.densify(ca.jacobian(self._target(t), t)))

    def _along(self, rows: ca.SX) -> ca.SX:
        if self.directions is None:
            return rows
        return ca.mtimes(ca.SX(np.asarray(self.directions)), rows)

    def _target(self, t: ca.SX) -> ca.SX:
        return _at(self.path, t, (3, 1), self._what)

    def place(self, t: ca.SX) -> ca.SX | None:
        """Return p_d(t) (3,) [m] where all directions count."""
        return self._target(t) if self.directions is None else None

    @property
    def _what(self) -> str:
        return f"position task of '{self.frame}': path"


@dataclass(frozen=True, eq=False)
class OrientationTask(SpaceTask):
    """A frame is turned as it is told; its error is ``rotation_error``.

    Args:
        frame: name of the frame.
        rotation: R_d (3, 3), numbers, or a function of the symbol of time.

    Raises:
        ProblemError: on a matrix that is no rotation.
    """

    frame: str
    rotation: ArrayLike | InTime

    def __post_init__(self) -> None:
        """Check frame and rotation."""
        check_instance(self.frame, str, "orientation task: frame")
        if not callable(self.rotation):
            checked_rotation(self.rotation, self._what)

    def error(self, robot: Robot, q: ca.SX, t: ca.SX) -> ca.SX:
        """Return the turn from R_d(t) to R(q) (3,) [rad], in the axes of R_d."""
        return rotation_error(self._target(t), robot.pose(q, self.frame).rotation)

    def jacobian(self, robot: Robot, q: ca.SX, t: ca.SX) -> ca.SX:
        """Return that of the angular velocity, in the axes of R_d (3, n).

        The rate of the logarithm is a matrix times the relative angular velocity, and this matrix
        leaves the logarithm as it is: a velocity of -k e is a rate of -k e, however large e is.
        """
        return ca.mtimes(self._target(t).T, robot.jacobian(q, self.frame)[3:, :])

    def rate(self, t: ca.SX) -> ca.SX:
        """Return the angular velocity of R_d in its own axes (3,) [rad/s]."""
        desired = self._target(t)
        change = ca.reshape(ca.densify(ca.jacobian(ca.vec(desired), t)), 3, 3)
        turning = ca.mtimes(desired.T, change)
        return ca.vertcat(turning[2, 1], turning[0, 2], turning[1, 0])

    def _target(self, t: ca.SX) -> ca.SX:
        return _at(self.rotation, t, (3, 3), self._what)

    @property
    def _what(self) -> str:
        return f"orientation task of '{self.frame}': rotation"


@dataclass(frozen=True, eq=False)
class PoseTask(SpaceTask):
    """A frame follows a path and is turned as it is told: six rows.

    Args:
        frame: name of the frame.
        path: p_d (3,) [m], as of ``PositionTask``.
        rotation: R_d (3, 3), as of ``OrientationTask``.
    """

    frame: str
    path: ArrayLike | InTime
    rotation: ArrayLike | InTime

    def __post_init__(self) -> None:
        """Check both parts."""
        _ = self._parts

    def error(self, robot: Robot, q: ca.SX, t: ca.SX) -> ca.SX:
        """Return the errors of position [m] and orientation [rad] (6,)."""
        return ca.vertcat(*[part.error(robot, q, t) for part in self._parts])

    def jacobian(self, robot: Robot, q: ca.SX, t: ca.SX) -> ca.SX:
        """Return both (6, n)."""
        return ca.vertcat(*[part.jacobian(robot, q, t) for part in self._parts])

    def rate(self, t: ca.SX) -> ca.SX:
        """Return both (6,)."""
        return ca.vertcat(*[part.rate(t) for part in self._parts])

    def place(self, t: ca.SX) -> ca.SX | None:
        """Return p_d(t) (3,) [m]."""
        return self._parts[0].place(t)

    @property
    def _parts(self) -> tuple[PositionTask, OrientationTask]:
        return PositionTask(self.frame, self.path), OrientationTask(self.frame, self.rotation)


def _at(given: Any, t: ca.SX, shape: tuple[int, int], what: str) -> ca.SX:
    """Return numbers, or what a function says at t, as a dense expression."""
    value: Any = given(t) if callable(given) else np.asarray(given, dtype=float).reshape(shape)
    return returned_expression(value, shape, what)
