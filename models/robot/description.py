"""What a robot description says: links, joints, masses and shapes, as data."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np

from models._numbers import checked_rotation, checked_tensor, vector
from ocp import ProblemError
from ocp.internal import check_choice, check_instance, check_not_negative, check_real

JointType: TypeAlias = Literal["fixed", "revolute", "continuous", "prismatic"]

# How far the length of an axis may be from 1.
_UNIT = 1e-9


@dataclass(frozen=True, eq=False)
class Pose:
    r"""Where one frame is in another: :math:`r \mapsto R r + p`.

    Args:
        rotation: R (3, 3), its columns are the axes of the frame.
        translation: p (3,) [m], its origin.

    Raises:
        ProblemError: on what is no rotation, or not three numbers.
    """

    rotation: np.ndarray
    translation: np.ndarray

    def __post_init__(self) -> None:
        """Check the numbers."""
        object.__setattr__(self, "rotation", checked_rotation(self.rotation, "pose: rotation"))
        object.__setattr__(self, "translation", vector(self.translation, 3, "pose: translation"))

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

    Raises:
        ProblemError: on a mass or a principal moment below 0, and what is not symmetric.
    """

    mass: float
    center: np.ndarray
    tensor: np.ndarray

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_not_negative(self.mass, "inertia: mass")
        object.__setattr__(self, "center", vector(self.center, 3, "inertia: center"))
        object.__setattr__(self, "tensor", checked_tensor(self.tensor, "inertia"))

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

    def __post_init__(self) -> None:
        """Check what they are."""
        check_instance(self.name, str, "link: name")
        if self.inertia is not None:
            check_instance(self.inertia, Inertia, f"link '{self.name}': inertia")
        for each in self.collisions:
            check_instance(each, Collision, f"link '{self.name}': a collision")


@dataclass(frozen=True)
class Limits:
    """What a joint may do, in [rad] or [m], [rad/s] or [m/s], [N m] or [N]; inf: no limit."""

    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("velocity", "effort"):
            check_not_negative(getattr(self, name), f"limits: {name}", finite=False)
        if not self.lower < self.upper:
            raise ProblemError(f"limits: lower = {self.lower} is not below upper = {self.upper}")


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

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_instance(self.joint, str, "mimic: joint")
        check_real(self.multiplier, f"mimic of '{self.joint}': multiplier")
        check_real(self.offset, f"mimic of '{self.joint}': offset")


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

    Raises:
        ProblemError: naming the joint: an unknown type, an axis of another length than 1, friction
            below 0.
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

    def __post_init__(self) -> None:
        """Check type, axis and friction."""
        check_instance(self.name, str, "joint: name")
        what = f"joint '{self.name}'"
        check_choice(self.type, get_args(JointType), f"{what}: type")
        check_instance(self.origin, Pose, f"{what}: origin")
        check_instance(self.limits, Limits, f"{what}: limits")
        if self.mimic is not None:
            check_instance(self.mimic, Mimic, f"{what}: mimic")
        for name in ("damping", "friction"):
            check_not_negative(getattr(self, name), f"{what}: {name}")
        axis = vector(self.axis, 3, f"{what}: axis")
        length = float(np.linalg.norm(axis))
        if self.type != "fixed" and abs(length - 1.0) > _UNIT:
            raise ProblemError(f"{what}: its axis has the length {length:g}, 1 is needed")
        object.__setattr__(self, "axis", axis)


@dataclass(frozen=True, eq=False)
class Description:
    """A robot as its file has it; ``read_urdf`` makes one.

    Args:
        name: of the robot.
        links: in the order of the file.
        joints: in the order of the file.

    Raises:
        ProblemError: if there is no link, or something else among links and joints.
    """

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]

    def __post_init__(self) -> None:
        """Check that there are links, and what all are."""
        check_instance(self.name, str, "description: name")
        for what, kind in (("links", Link), ("joints", Joint)):
            check_instance(getattr(self, what), (tuple, list), f"{self.name}: {what}")
            object.__setattr__(self, what, tuple(getattr(self, what)))
            for each in getattr(self, what):
                check_instance(each, kind, f"{self.name}: an entry of {what}")
        if not self.links:
            raise ProblemError(f"{self.name}: there are no links; one is the base")
