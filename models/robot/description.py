"""What a robot description says: links, joints, masses and shapes, as data."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

JointType: TypeAlias = Literal["fixed", "revolute", "continuous", "prismatic"]


@dataclass(frozen=True, eq=False)
class Pose:
    r"""Where one frame is in another: :math:`r \mapsto R r + p`.

    Args:
        rotation: R (3, 3), its columns are the axes of the frame.
        translation: p (3,) [m], its origin.
    """

    rotation: np.ndarray
    translation: np.ndarray

    def __matmul__(self, inner: "Pose") -> "Pose":
        """Return the pose of what is at ``inner`` in this frame."""
        return Pose(
            self.rotation @ inner.rotation, self.rotation @ inner.translation + self.translation
        )

    @property
    def inverse(self) -> "Pose":
        """The outer frame, seen from the inner one."""
        return Pose(self.rotation.T, -self.rotation.T @ self.translation)

    @classmethod
    def identity(cls) -> "Pose":
        """Return the pose of a frame in itself."""
        return cls(np.eye(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class Inertia:
    """The mass of a link and how it is spread.

    Args:
        mass: [kg].
        center: centre of mass (3,) [m], in the frame of the link.
        tensor: moments of inertia (3, 3) [kg m^2] about the centre of mass, in the axes of the
            link.
    """

    mass: float
    center: np.ndarray
    tensor: np.ndarray

    @property
    def pseudo_inertia(self) -> np.ndarray:
        r"""The integral of :math:`(r, 1)(r, 1)' \, dm` (4, 4) in the frame of the link.

        Its blocks are the second moments [kg m^2], the first moments [kg m] and the mass [kg].
        Rigid parts are joined by adding it, and moved by T J T' with the 4 x 4 matrix T of a pose.
        """
        h = self.mass * self.center
        second = np.trace(self.tensor) / 2.0 * np.eye(3) - self.tensor
        second = second + np.outer(h, self.center)
        return np.block([[second, h[:, None]], [h[None, :], np.array([[self.mass]])]])


@dataclass(frozen=True)
class BoxShape:
    """A box with its middle at the origin; ``size`` (3,) [m] is its whole length, width, height."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class SphereShape:
    """A ball round the origin, of ``radius`` [m]."""

    radius: float


@dataclass(frozen=True)
class CylinderShape:
    """A cylinder round the z axis, its middle at the origin; ``radius`` and ``length`` [m]."""

    radius: float
    length: float


@dataclass(frozen=True)
class MeshShape:
    """A surface in a file.

    Args:
        file: as the description has it, often ``package://name/...``; see ``resolve_file``.
        scale: of the three axes.
    """

    file: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


Shape: TypeAlias = BoxShape | SphereShape | CylinderShape | MeshShape


@dataclass(frozen=True, eq=False)
class Collision:
    """What a link may hit with: a shape, and where it is in the frame of the link."""

    shape: Shape
    pose: Pose
    name: str = ""


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid part.

    Args:
        name: unique in its robot.
        inertia: None where the description says nothing.
        collisions: its shapes.
    """

    name: str
    inertia: Inertia | None = None
    collisions: tuple[Collision, ...] = ()


@dataclass(frozen=True)
class Limits:
    """What a joint may do, in [rad] or [m], [rad/s] or [m/s], [N m] or [N]; inf: no limit."""

    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of all joints of a robot, each an array (n,); inf: none.

    Attributes:
        lower: least position [rad] or [m].
        upper: largest position [rad] or [m].
        velocity: largest speed, both ways [rad/s] or [m/s].
        effort: largest torque or force, both ways [N m] or [N].
    """

    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


@dataclass(frozen=True)
class Mimic:
    """A joint that another one moves: q = multiplier * q_of + offset."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Joint:
    """How a link moves against its parent.

    Args:
        name: unique in its robot.
        type: ``"revolute"`` and ``"continuous"`` turn about the axis, ``"prismatic"`` slides
            along it.
        parent: name of a link.
        child: name of a link.
        origin: pose of the child in the parent where the joint is at 0.
        axis: unit vector (3,), in the frame of the child.
        limits: of position, velocity and effort.
        damping: viscous friction [N m s/rad] or [N s/m].
        friction: Coulomb friction [N m] or [N].
        mimic: None where the joint moves by itself.
    """

    name: str
    type: JointType
    parent: str
    child: str
    origin: Pose
    axis: np.ndarray
    limits: Limits = Limits()
    damping: float = 0.0
    friction: float = 0.0
    mimic: Mimic | None = None


@dataclass(frozen=True, eq=False)
class Description:
    """A robot as its file has it; ``read_urdf`` makes one.

    Args:
        name: of the robot.
        links: in the order of the file.
        joints: in the order of the file.
    """

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
