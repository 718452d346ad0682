"""A robot: any tree of rigid bodies from a description, with its kinematics and dynamics."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._ldl import ldl_solve
from models.robot.coordinates import checked_columns
from models.robot.description import Description, JointLimits, Pose
from models.robot.inverse_dynamics import newton_euler
from models.robot.kinematics import FramePose, attached, body_poses, geometric_jacobian
from models.robot.locked import locked
from models.robot.mass_matrix import composite_mass_matrix, singular_coordinate
from models.robot.payload import Payload
from models.robot.tree import Tree, tree_of
from models.robot.urdf import read_urdf
from ocp import ProblemError
from ocp.internal import check_instance, check_numbers, check_positive

# What M is called; and at how many places it is asked whether it is regular.
_MASSES, _PLACES = "mass matrix", 3


@dataclass(frozen=True, eq=False)
class Robot:
    r"""A tree of rigid bodies on a base that does not move.

    .. math:: M(q) \ddot q + c(q, \dot q) + g(q) + d\,\dot q + f \tanh(\dot q / v_f) = \tau

    with the armature on the diagonal of M, damping d and Coulomb friction f. A joint that mimics
    another has no coordinate; it moves with the one that it follows, which bears its loads and its
    friction too. Revolute and continuous joints have their angle as coordinate [rad], prismatic
    ones their way [m].

    Every method takes coordinates as ``SX``, ``MX`` or numbers, columns (n,), and returns what it
    was given: an expression, or a ``DM``. What it computes is built once.

    Args:
        description: of its links and joints; ``Robot.from_urdf`` reads one.
        gravity: (3,) [m/s^2], in the axes of the base.
        armature: inertia of the rotors, seen at the joints, a number or (n,) [kg m^2] or [kg].
        payload: what it carries; None: nothing.
        friction_speed: v_f [rad/s] or [m/s], below which Coulomb friction fades.

    Raises:
        ProblemError: naming the link or joint at which the description is no tree, or a number
            that is wrong.
    """

    description: Description
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    armature: ArrayLike = 0.0
    payload: Payload | None = None
    friction_speed: float = 0.01

    def __post_init__(self) -> None:
        """Check the numbers, and that the links are a tree."""
        check_instance(self.description, Description, "robot: description")
        name = self.description.name
        gravity = check_numbers(self.gravity, 3, f"{name}: gravity", repeat=False)
        armature = check_numbers(self.armature, self.n, f"{name}: armature")
        if (armature < 0.0).any():
            raise ProblemError(f"{name}: armature = {armature}: it must be 0 or more")
        check_positive(self.friction_speed, f"{name}: friction_speed")
        object.__setattr__(self, "gravity", gravity)
        object.__setattr__(self, "armature", armature)
        if self.payload is not None:
            check_instance(self.payload, Payload, f"{name}: payload")
            self._frame(self.payload.frame)

    @classmethod
    def from_urdf(cls, source: str | Path, *, tidy: float = 1e-9) -> "Robot":
        """Return the robot of a URDF, see ``read_urdf``.

        Raises:
            ProblemError: as ``read_urdf`` and ``Robot`` do.
        """
        return cls(read_urdf(source, tidy=tidy))

    def locked(self, joints: Mapping[str, float]) -> "Robot":
        """Return the robot with some joints fixed, by name, where they are told [rad] or [m].

        Raises:
            ProblemError: naming a joint that is not there, or does not move by itself, or numbers
                of armature that differ: give the armature afterwards.
        """
        if np.ptp(np.asarray(self.armature)) if self.n else 0.0:
            raise ProblemError(f"{self.name}: lock joints first, then give each its armature")
        armature = float(np.max(np.asarray(self.armature), initial=0.0))
        return replace(self, description=locked(self.description, joints), armature=armature)

    def without_friction(self) -> "Robot":
        """Return the robot with neither damping nor Coulomb friction."""
        joints = tuple(replace(j, damping=0.0, friction=0.0) for j in self.description.joints)
        return replace(self, description=replace(self.description, joints=joints))

    def carrying(self, payload: Payload) -> "Robot":
        """Return the robot with a payload, in place of what it carries."""
        return replace(self, payload=payload)

    # -- what it consists of --------------------------------------------------------

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.description.name

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return self.tree.n

    @cached_property
    def tree(self) -> Tree:
        """The bodies, numbered."""
        return tree_of(self.description)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move by themselves, in the order of q."""
        return tuple(joint.name for joint in self.tree.joints)

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames: those of the links."""
        return tuple(self.tree.frames)

    @property
    def units(self) -> tuple[str, ...]:
        """Of the coordinates, "rad" or "m"."""
        return tuple("m" if j.type == "prismatic" else "rad" for j in self.tree.joints)

    @cached_property
    def limits(self) -> JointLimits:
        """What the joints may do, in the order of q; what mimics them is not asked."""
        each = [joint.limits for joint in self.tree.joints]
        return JointLimits(
            lower=np.array([one.lower for one in each]),
            upper=np.array([one.upper for one in each]),
            velocity=np.array([one.velocity for one in each]),
            effort=np.array([one.effort for one in each]),
        )

    # -- kinematics -----------------------------------------------------------------

    def pose(self, q: Any, frame: str) -> FramePose:
        """Return where a frame is in the world: its ``rotation`` (3, 3) and ``position`` (3,)."""
        body, pose = self._frame(frame)

        def build(q: ca.SX) -> list[ca.SX]:
            found = attached(body_poses(self.tree, q), body, pose)
            return [found.rotation, found.position]

        return FramePose(*self._call(f"pose of {frame}", build, q))

    def position(self, q: Any, frame: str) -> Any:
        """Return the origin of a frame in the world (3,) [m]."""
        return self.pose(q, frame).position

    def jacobian(self, q: Any, frame: str) -> Any:
        r"""Return J (6, n): velocity and angular velocity of a frame, in the axes of the world.

        .. math:: (\dot p, \omega) = J(q) \, \dot q
        """
        body, pose = self._frame(frame)
        name = f"jacobian of {frame}"
        return self._call(name, lambda q: [geometric_jacobian(self.tree, q, body, pose)], q)[0]

    # -- dynamics -------------------------------------------------------------------

    def inverse_dynamics(self, q: Any, v: Any, a: Any) -> Any:
        """Return the efforts τ (n,) [N m] or [N] that the acceleration a takes at q, v."""
        self._check_masses()
        return self._call("inverse dynamics", self._efforts, q, v, a)[0]

    def gravity_efforts(self, q: Any) -> Any:
        """Return the efforts g(q) (n,) that hold the robot where it is."""
        self._check_masses()
        zero = ca.SX(np.zeros(self.n))
        return self._call("gravity", lambda q: self._efforts(q, zero, zero), q)[0]

    def mass_matrix(self, q: Any) -> Any:
        """Return M(q) (n, n) [kg m^2], [kg m] or [kg], with the armature."""
        self._check_masses()
        return self._call(_MASSES, lambda q: [self._mass_matrix(q)], q)[0]

    def forward_dynamics(self, q: Any, v: Any, effort: Any) -> Any:
        """Return the accelerations (n,) that efforts τ cause at q, v: M a = τ - h, by L D L'."""
        self._check_masses()
        given = q, v, effort
        return self._call("forward dynamics", lambda *z: [self._forward(*z)], *given)[0]

    def forward_dynamics_derivatives(self, q: Any, v: Any, effort: Any) -> tuple[Any, ...]:
        r"""Return the accelerations a (n,) and their Jacobians in q, v and τ, each (n, n).

        They are taken through the inverse dynamics τ(q, v, a), which costs half of what it costs
        to differentiate the forward dynamics:

        .. math::

            \frac{\partial a}{\partial (q, v)} = -M^{-1} \frac{\partial \tau}{\partial (q, v)},
            \quad \frac{\partial a}{\partial \tau} = M^{-1}

        Source: [Carpentier & Mansard 2018].
        """
        self._check_masses()
        return tuple(self._call("derivatives", self._derivatives, q, v, effort))

    # -- expressions ----------------------------------------------------------------

    def _efforts(self, q: ca.SX, v: ca.SX, a: ca.SX) -> list[ca.SX]:
        rigid = newton_euler(self.tree, self._inertias(), q, v, a, np.asarray(self.gravity))
        return [rigid + self._friction(v) + ca.SX(np.asarray(self.armature)) * a]

    def _friction(self, v: ca.SX) -> ca.SX:
        """Return what all joints lose; one that mimics adds to the one that it follows."""
        lost = ca.SX.zeros(self.n)
        for body in self.tree.bodies:
            speed = body.factor * v[body.coordinate]
            own = body.damping * speed + body.friction * ca.tanh(speed / self.friction_speed)
            lost[body.coordinate] += body.factor * own
        return lost

    def _mass_matrix(self, q: ca.SX) -> ca.SX:
        rotors = ca.SX(np.diag(np.asarray(self.armature)))
        return composite_mass_matrix(self.tree, self._inertias(), q) + rotors

    def _forward(self, q: ca.SX, v: ca.SX, effort: ca.SX) -> ca.SX:
        (bias,) = self._efforts(q, v, ca.SX(np.zeros(self.n)))
        return ldl_solve(self._mass_matrix(q), effort - bias)

    def _derivatives(self, q: ca.SX, v: ca.SX, effort: ca.SX) -> list[ca.SX]:
        a = ca.SX.sym("a", self.n)
        (needed,) = self._efforts(q, v, a)
        slopes = ca.jacobian(needed, ca.vertcat(q, v))
        matrix = self._mass_matrix(q)
        right = ca.horzcat(
            effort - ca.substitute(needed, a, ca.SX(np.zeros(self.n))), ca.SX(np.eye(self.n))
        )
        solved = ldl_solve(matrix, right)
        found, inverse = solved[:, 0], solved[:, 1:]
        moved = -ca.mtimes(inverse, ca.substitute(slopes, a, found))
        return [found, moved[:, : self.n], moved[:, self.n :], inverse]

    def _inertias(self) -> list[ca.SX]:
        found = [ca.SX(inertia) for inertia in self.tree.inertias()]
        if self.payload is not None:
            body, pose = self._frame(self.payload.frame)
            if body >= 0:
                found[body] = found[body] + self.payload.pseudo_inertia(pose)
        return found

    # -- calling --------------------------------------------------------------------

    @cached_property
    def _functions(self) -> dict[str, ca.Function]:
        """What was built so far, by its name."""
        return {}

    def _call(self, name: str, build: Callable[..., list[ca.SX]], *given: Any) -> list[Any]:
        """Return expressions of q (and v, and a or τ) at what is given; each is built once."""
        unknown = ca.SX(0, 1) if self.payload is None else self.payload.symbols
        columns = checked_columns(given, self.n, f"{self.name}: {name}", unknown)
        if name not in self._functions:
            symbols = [ca.SX.sym(letter, self.n) for letter in "qva"[: len(given)]]
            self._functions[name] = ca.Function("robot", [*symbols, unknown], build(*symbols))
        parameters = unknown if unknown.numel() else ca.DM(0, 1)
        return list(self._functions[name].call([*columns, parameters], True, False))

    def _frame(self, frame: str) -> tuple[int, Pose]:
        if not isinstance(frame, str) or frame not in self.tree.frames:
            raise ProblemError(
                f"{self.name} has no frame {frame!r}; its frames are {', '.join(self.frames)}"
            )
        return self.tree.frames[frame]

    def _check_masses(self) -> None:
        """Refuse dynamics where nothing would resist a joint."""
        if self._unresisted is not None:
            joint = self.tree.joints[self._unresisted]
            raise ProblemError(
                f"{self.name}: joint '{joint.name}' moves link '{joint.child}', and no inertia "
                "resists it (the mass matrix is singular): add <inertial> with moments of inertia, "
                "give an armature, or lock the joint; kinematics need no masses"
            )

    @cached_property
    def _unresisted(self) -> int | None:
        """The joint whose pivot of M vanishes wherever it is asked for; what is unknown is 1."""
        if not self.n:
            return None
        unknown = ca.SX(0, 1) if self.payload is None else self.payload.symbols
        places = np.random.default_rng(0).uniform(-1.0, 1.0, (_PLACES, self.n))
        found = [self._call(_MASSES, lambda q: [self._mass_matrix(q)], q)[0] for q in places]
        matrices = [ca.evalf(ca.substitute(ca.SX(m), unknown, 1.0)) for m in found]
        return singular_coordinate([np.array(matrix) for matrix in matrices])
