"""A planar arm of any number of links: where its joints are and how they move."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import vector
from ocp import ProblemError


@dataclass(frozen=True)
class PlanarArm:
    r"""A planar arm with revolute joints and relative joint angles.

    .. math::

        p_0 = \text{base}, \quad
        p_{i+1} = p_i + l_i \, (\cos\varphi_i, \sin\varphi_i)', \quad
        \varphi_i = \theta_0 + \dots + \theta_i

    Every method takes joint angles [rad] as a casadi ``SX`` or ``MX`` column (n,) and then
    returns an expression, or as numbers and then returns a ``DM``.

    Source: thesis (3.30), figure 3.2.

    Args:
        lengths: of the links, from base to end effector [m], all positive.
        base: position of the first joint (2,) [m].

    Raises:
        ProblemError: naming the link whose length is no positive number.
    """

    lengths: tuple[float, ...]
    base: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the numbers."""
        count = np.size(self.lengths)
        if count == 0:
            raise ProblemError("arm: it has no links, at least one length is needed")
        lengths = vector(self.lengths, count, "arm: length of link")
        for link in np.flatnonzero(lengths <= 0.0):
            raise ProblemError(f"arm: length of link[{link}] is {lengths[link]} m, not positive")
        base = vector(self.base, 2, "arm: base")
        object.__setattr__(self, "lengths", tuple(lengths.tolist()))
        object.__setattr__(self, "base", tuple(base.tolist()))

    @property
    def n(self) -> int:
        """Number of links, and of joints."""
        return len(self.lengths)

    @property
    def reach(self) -> tuple[float, float]:
        """Smallest and largest distance of the end effector from the base [m]."""
        total = sum(self.lengths)
        return max(0.0, 2.0 * max(self.lengths) - total), total

    def joints(self, theta: ca.SX | ArrayLike) -> ca.SX:
        """Return base, joints and end effector (2, n + 1) [m]."""
        angles, angle = self._angles(theta), 0.0
        points: list = [ca.DM(self.base)]  # DM or SX, as the angles are
        for i, length in enumerate(self.lengths):
            angle = angle + angles[i]
            points.append(points[-1] + length * ca.vertcat(ca.cos(angle), ca.sin(angle)))
        return ca.horzcat(*points)

    def end_effector(self, theta: ca.SX | ArrayLike) -> ca.SX:
        """Return r(theta), the position of the end effector (2,) [m]."""
        return self.joints(theta)[:, -1]

    def orientation(self, theta: ca.SX | ArrayLike) -> ca.SX:
        """Return the direction of the last link [rad], a scalar, not wrapped."""
        return ca.sum1(self._angles(theta))

    def jacobian(self, theta: ca.SX | ArrayLike) -> ca.SX:
        """Return J = dr/dtheta (2, n) [m].

        Turning joint i moves the end effector at right angles to the line from the joint.
        """
        joints = self.joints(theta)
        lever = [joints[:, -1] - joints[:, i] for i in range(self.n)]
        return ca.horzcat(*[ca.vertcat(-arm[1], arm[0]) for arm in lever])

    def positions(self, theta: ArrayLike) -> np.ndarray:
        """Return the joints along a trajectory, for drawing.

        Args:
            theta: joint angles (N + 1, n) [rad], a row per instant.

        Returns:
            base, joints and end effector (N + 1, n + 1, 2) [m].

        Raises:
            ProblemError: if ``theta`` has another width.
        """
        rows = np.atleast_2d(np.asarray(theta, dtype=float))
        if rows.ndim != 2 or rows.shape[1] != self.n:
            raise ProblemError(f"arm: theta has shape {rows.shape}, (N + 1, {self.n}) is needed")
        angles = np.cumsum(rows, axis=1)
        links = np.stack([np.cos(angles), np.sin(angles)], axis=2) * np.array(self.lengths)[:, None]
        steps = np.concatenate([np.broadcast_to(self.base, (len(rows), 1, 2)), links], axis=1)
        return np.cumsum(steps, axis=1)

    def _angles(self, theta: ca.SX | ArrayLike) -> Any:
        angles: Any = theta
        if not isinstance(theta, ca.SX | ca.MX):
            angles = ca.DM(np.array(theta, dtype=float).reshape(-1))
        if angles.numel() != self.n:
            raise ProblemError(f"arm: theta has {angles.numel()} entries, it has {self.n} links")
        return angles
